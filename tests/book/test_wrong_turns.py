"""Wrong turns in the notebooks with blanks: each is met by its grader, with a sentence that helps."""

from collections.abc import Callable
from typing import Any

import pytest

from inbounds.book.exercises import advantages_of_actions, many_steps_from_one_batch, ppo, trpo
from inbounds.book.exercises.checks import trpo_updates
from inbounds.book.exercises.checks.small_updates import FAR, QUIET, Small
from inbounds.book.exercises.judging import Judgement
from tests.book.test_programs_from_blanks import changed

LAW = "self.law(self.net(obs)).log_prob(latent).sum(-1)"
RESIDUAL = "batch.reward + gamma * (1 - batch.terminated) * after - value"
FOLLOWS = "residual[t] + keep[t] * later"
RATIO = "(policy.log_prob(batch.obs, batch.latent) - old_log_prob).exp()"
CLIP = "ratio.clamp(1 - clip_range, 1 + clip_range)"
TAKEN = "x + length * direction"
STEP = "square / (direction @ image)"
ROOT = "(2 * max_kl / (x @ product(x))).sqrt() * x"
SQUARES = "error.square().mean()"
KL = "policy.kl(old_outputs, batch.obs)"
SEARCH = "line_search(gain, mean_kl, weights, full, max_kl)"
PIECES = "torch.randperm(len(to_go)).split(size)"

PPO_TURNS = [
    ("Policy", LAW, LAW + ".exp()", "that is the density"),
    ("Policy", LAW, LAW.replace("latent", "torch.as_tensor(self.to_box(latent))"), "not the action"),
    ("Policy", LAW, LAW + ".detach()", "no gradient reaches the policy"),
    ("Policy", "return self.law(self.net(obs)).ent", "return -self.law(self.net(obs)).ent", "sign is wrong"),
    ("Policy", "kl_divergence(old, new)", "kl_divergence(new, old)", "the old law comes first"),
    ("advantages", RESIDUAL, RESIDUAL.replace("gamma * ", ""), "γ is missing in the residual"),
    ("advantages", RESIDUAL, RESIDUAL.replace("- value", "+ value"), "*subtracts* the value"),
    ("advantages", RESIDUAL, f"-({RESIDUAL})", "sign of the residual"),
    ("advantages", "reversed(range(len(value)))", "range(len(value))", "from the last row to the first"),
    ("advantages", FOLLOWS, "keep[t] * (residual[t] + later)", "not the residual too"),
    ("advantages", FOLLOWS, "residual[t] + keep.roll(-1)[t] * later", "row t, not row t + 1"),
    ("advantages", "advantage + value", f"{RESIDUAL} + value", "not the reward plus the next value"),
    ("advantages", "return advantage,", "return (advantage - advantage.mean()) / (advantage.std() + 1e-8),", "later"),
    ("advantages", "critic(batch.next_obs).detach()",
     "torch.cat([critic(batch.obs)[1:], critic(batch.next_obs)[-1:]]).detach()", "not that of the next row"),
    ("surrogate", RATIO, RATIO.replace(" - old_log_prob).exp()", ").exp() - old_log_prob.exp()"), "*quotient*"),
    ("surrogate", CLIP, "ratio.clamp(-clip_range, clip_range)", "about 1 and not about 0"),
    ("surrogate", CLIP, "ratio.clamp(max=1 + clip_range)", "the clip has two ends"),
    ("surrogate", CLIP, "ratio.log().clamp(-clip_range, clip_range).exp()", "not its logarithm"),
    ("surrogate", CLIP, "ratio.clamp(0.8, 1.2)", "not always 0.2"),
    ("surrogate", "clipped * advantage", "(ratio * advantage).clamp(1 - clip_range, 1 + clip_range)", "its product"),
    ("surrogate", "ratio * advantage, clipped * advantage",
     "ratio * advantage[:, None], clipped * advantage[:, None]", "[B, B]"),
    ("surrogate", "clipped = ratio",
     "advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)\n    clipped = ratio", "as they are here"),
    ("surrogate", "return ", "", "it returns nothing"),
    ("loss", "value_coef * error", "error", "value_coef does not reach"),
    ("loss", ".square().mean()", ".square().mean() / 2", "half the squared error"),
    ("loss", ".square().mean()", ".square().sum()", "that is a sum"),
    ("loss", ".square().mean()", ".mean().square()", "square of the mean error"),
    ("loss", ".square().mean()", ".abs().mean()", "absolute errors"),
    ("loss", ".square().mean()", ".mean()", "not squared"),
    ("loss", "- to_go)", "- advantage)", "learns to_go"),
    ("loss", "critic(batch.obs)", "critic(batch.obs).detach()", "no gradient reaches the critic"),
    ("loss", "batch, advantage, old_log_prob", "batch, to_go, old_log_prob", "third argument is the advantage"),
    ("loss", "batch, advantage, old_log_prob", "batch, old_log_prob, advantage", "old_log_prob fourth"),
    ("loss", "value_coef * error - gain - entropy_coef * bonus",
     "value_coef * (error - gain - entropy_coef * bonus)", "error alone"),
    ("loss", " - entropy_coef * bonus", "", "bonus is missing"),
    ("loss", "entropy(batch.obs).mean()", "entropy(batch.obs).sum()", "entropies are summed"),
    ("normalized", " / (x.std() + 1e-8)", "", "does not divide"),
    ("normalized", "x.std()", "x.var()", "the variance"),
    ("normalized", "(x - x.mean())", "x", "does not subtract"),
    ("step", "\n    adam.step()", "", "adam.step() is missing"),
    ("step", "loss.backward()", "(-loss).backward()", "climbs the loss"),
    ("step", "clip_grad_norm_", "clip_grad_value_", "clip_grad_norm_"),
    ("update", PIECES, "torch.arange(len(to_go)).split(size)", "not shuffled"),
    ("update", "    for _ in range(passes):",
     "    for _ in range(passes):\n        old_log_prob = policy.log_prob(batch.obs, batch.latent).detach()",
     "anew in each pass"),
]  # fmt: skip

TRPO_TURNS = [
    ("surrogate", RATIO, "policy.log_prob(batch.obs, batch.latent) / old_log_prob", "ratio of *densities*"),
    ("surrogate", RATIO, RATIO.replace(" - old_log_prob).exp()", ").exp() - old_log_prob.exp()"), "*quotient*"),
    ("surrogate", "(ratio * advantage).mean()", "ratio.mean() * advantage.mean()", "mean of the products"),
    ("conjugate_gradient", "residual - length * image", "residual + length * image", "the residual falls"),
    ("conjugate_gradient", TAKEN, "x + length * image", "not along its image"),
    ("conjugate_gradient", TAKEN, "x + length * residual", "not along the residual"),
    ("conjugate_gradient", STEP, "(direction @ image) / square", "upside down"),
    ("conjugate_gradient", STEP, "square / (image @ image)", "not by image · image"),
    ("conjugate_gradient", STEP, "square**0.5 / (direction @ image)", "not its root"),
    ("conjugate_gradient", "residual + (residual", "residual - (residual", "*added*"),
    ("conjugate_gradient", "square = residual @ residual", "square = b @ b", "computed once"),
    ("conjugate_gradient", "torch.zeros_like(b), b, b", "b, b, b", "starts at 0"),
    ("conjugate_gradient", "    return x", "        return x", "behind the loop"),
    ("natural_step", ROOT, "(x @ product(x) / (2 * max_kl)).sqrt() * x", "upside down"),
    ("natural_step", ROOT, "(max_kl / (2 * (x @ product(x)))).sqrt() * x", "wrong side"),
    ("natural_step", "x @ product(x)", "gradient @ gradient", "not b · b"),
    ("natural_step", "x @ product(x)", "gradient @ product(gradient)", "not b · product(b)"),
    ("natural_step", "conjugate_gradient(product, gradient)", "product(gradient)", "solve with conjugate_gradient"),
    ("natural_step", "conjugate_gradient(product, gradient)", "conjugate_gradient(product, gradient, 2)", "ten"),
    ("natural_step", "grad(gain(), weights)", "grad(mean_kl(), weights)", "gradient of gain()"),
    ("line_search", "0.5**k", "0.8**k", "*first* that will do"),
    ("line_search", "0.5**k", "1 / (k + 1)", "*first* that will do"),
    ("update", SQUARES, f"{SQUARES} / 2", "half the squared error"),
    ("update", SQUARES, f"2 * {SQUARES}", "twice the squared error"),
    ("update", SQUARES, "error.square().sum()", "summed"),
    ("update", SQUARES, "error.abs().mean()", "absolute errors"),
    ("update", "critic(batch.obs[index]) -", "critic(batch.obs[index])[:, None] -", "[B, B]"),
    ("update", "- to_go[index]", "- advantage[index]", "it learns the advantages"),
    ("update", "- to_go[index]", "- normalized(to_go)[index]", "targets are normalised"),
    ("update", "critic(batch.obs[index])", "critic(batch.next_obs[index])", "not about next_obs"),
    ("update", "critic(batch.obs[index]) - to_go[index]", "critic(batch.obs) - to_go", "the whole batch"),
    ("update", PIECES, "torch.arange(len(to_go)).split(size)", "not shuffled"),
    ("update", "range(passes)", "range(1)", "only one pass"),
    ("update", f"step(adam, {SQUARES})", f"(adam.zero_grad(), {SQUARES}.backward(), adam.step())", "not clipped"),
    ("update", KL, "policy.kl(policy.net(batch.obs).detach(), batch.obs)", "2.0 max_kl"),
    ("update", SEARCH, "vector_to_parameters(parameters_to_vector(weights) + full, weights)", "2.0 max_kl"),
    ("update", SEARCH, SEARCH.replace("max_kl)", "2 * max_kl)"), "with max_kl"),
]  # fmt: skip

GRADERS: dict[tuple[str, str], Callable[..., Judgement]] = {
    ("ppo", "advantages"): advantages_of_actions.advantages,
    ("ppo", "Policy"): ppo.policy,
    ("ppo", "normalized"): ppo.update,
    ("ppo", "step"): ppo.update,
    ("trpo", "surrogate"): many_steps_from_one_batch.surrogate,
}
TURNS = [("ppo", *turn) for turn in PPO_TURNS] + [("trpo", *turn) for turn in TRPO_TURNS]


@pytest.mark.parametrize(("name", "block", "old", "new", "words"), TURNS)
def test_a_wrong_turn_is_met(name: str, block: str, old: str, new: str, words: str) -> None:
    module: Any = {"ppo": ppo, "trpo": trpo}[name]
    grader = GRADERS.get((name, block)) or getattr(module, block)
    judged = "update" if grader is module.update else block
    verdict = grader(changed(name, block, old, new)[judged])
    assert verdict.passed is not True
    assert words in verdict.message


def test_other_words_for_the_same_thing_are_not_refused() -> None:
    ours = changed("ppo", "surrogate", "torch.minimum(", "torch.min(")
    assert ppo.surrogate(ours["surrogate"]).passed is True
    ours = changed("ppo", "loss", ".square().mean()", ".pow(2).sum() / len(to_go)")
    assert ppo.loss(ours["loss"]).passed is True
    ours = changed("trpo", "conjugate_gradient", "direction @ image", "residual @ image")  # the same number
    assert trpo.conjugate_gradient(ours["conjugate_gradient"]).passed is True
    ours = changed("trpo", "update", SQUARES, "error.pow(2).mean()")
    assert trpo.update(ours["update"]).passed is True


def test_the_flaws_of_a_regression_lead_to_places_of_their_own() -> None:
    """Where no gradient is clipped; that it is not is seen where one is."""
    flaws = [*trpo_updates.MISTAKES.values(), ""]
    ends = {flaw: tuple(Small(unit=0.01).critic_after_a_flawed(flaw, QUIET).tolist()) for flaw in flaws}
    assert len({tuple(round(w, 9) for w in end) for end in ends.values()}) == len(flaws) - 1
    assert ends["free"] == pytest.approx(ends[""])


def test_the_line_search_has_something_to_do() -> None:
    """Without it the divergence would be twice what is allowed."""
    narrow = Small(log_scale=trpo_updates.NARROW)
    moved = narrow.after_the_packages(FAR) - narrow.weights()
    assert moved[: narrow.actor_size].norm() > 0.1
