import dataclasses
from collections.abc import Callable

import pytest
import torch

from inbounds.learning import Trainer, TRPOConfig, trpo
from inbounds.learning.networks.perceptron import flatten
from tests.learning.point import PointEnv
from tests.learning.small import FAMILIES, small_config, small_run


def started(family: str = "gaussian", horizon: int = 32, **options) -> tuple:
    options = {"hidden": (4,), "seeds": 2, "horizon": horizon} | options
    trainer = Trainer(small_config("trpo", family, dtype="float64", **options), PointEnv)
    nets = trainer.networks
    nets.actor.theta.add_(0.3 * torch.randn_like(nets.actor.theta))
    return trainer, nets, trainer.collector.collect(horizon)


def explicit_hessian(nets, rollout, seed: int) -> torch.Tensor:
    """∇²KL(old‖new) of one seed at new = old, entry by entry: the gradient's gradient, a row at a time."""
    parameters = nets.parameters(rollout.obs)
    kl = nets.policy.law.kl(parameters.detach(), parameters)[seed].mean()
    weights = nets.actor.parameters
    gradient = flatten(torch.autograd.grad(kl, weights, create_graph=True))[seed]
    rows = [flatten(torch.autograd.grad(g, weights, retain_graph=True))[seed] for g in gradient]
    return torch.stack(rows)


def explicit_fisher(nets, rollout, seed: int) -> torch.Tensor:
    """The mean of score · scoreᵀ of one seed's drawn latents, a score at a time."""
    log_prob = nets.policy.law.log_prob(nets.parameters(rollout.obs), rollout.latent)[seed]
    weights = nets.actor.parameters
    scores = torch.stack(
        [flatten(torch.autograd.grad(x, weights, retain_graph=True))[seed] for x in log_prob]
    )
    return scores.T @ scores / len(scores)


def explicit_gradient(nets, rollout, advantage: torch.Tensor) -> torch.Tensor:
    """The surrogate's where ratios are 1 and entropy has no weight, `[S, P]`: the policy gradient."""
    log_prob = nets.policy.law.log_prob(nets.parameters(rollout.obs), rollout.latent)
    objective = (log_prob * advantage).mean(1).sum()
    return flatten(torch.autograd.grad(objective, nets.actor.parameters))


@pytest.mark.parametrize("family", FAMILIES)
def test_the_product_is_with_the_hessian(family: str) -> None:
    _, nets, rollout = started(family)
    product = trpo.kl_hessian_product(nets, rollout.obs)
    v = torch.randn(nets.actor.theta.shape, dtype=torch.float64)
    for s in range(2):
        hessian = explicit_hessian(nets, rollout, s)
        assert torch.allclose(hessian, hessian.T, atol=1e-10)
        assert torch.linalg.eigvalsh(hessian).min() > -1e-10
        assert torch.allclose(product(v)[s], hessian @ v[s], rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_sampled_fisher_is_the_mean_of_score_times_score(family: str) -> None:
    _, nets, rollout = started(family)
    product = trpo.sampled_fisher_product(nets, rollout.obs, rollout.latent)
    v = torch.randn(nets.actor.theta.shape, dtype=torch.float64)
    for s in range(2):
        assert torch.allclose(product(v)[s], explicit_fisher(nets, rollout, s) @ v[s], rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("family", FAMILIES)
def test_in_expectation_the_sampled_fisher_is_the_hessian(family: str) -> None:
    """Many latents for few states: the quadratic form vᵀFv both ways, within its own standard error."""
    _, nets, rollout = started(family)
    copies = 3000
    obs = rollout.obs[:, :4].repeat(1, copies, 1)
    parameters = nets.parameters(obs).detach()
    if family == "beta":
        latent = torch.distributions.Beta(*parameters).sample()
    else:
        loc, log_scale = parameters
        latent = loc + log_scale.exp() * torch.randn_like(loc)
    v = torch.randn(nets.actor.theta.shape, dtype=torch.float64)
    log_prob = nets.policy.law.log_prob(nets.parameters(obs), latent)
    w = torch.ones_like(log_prob, requires_grad=True)
    score = flatten(torch.autograd.grad((w * log_prob).sum(), nets.actor.parameters, create_graph=True))
    (along,) = torch.autograd.grad((score * v).sum(), w)
    error = along.square().std(1) / along.shape[1] ** 0.5
    sampled = trpo.dot(v, trpo.sampled_fisher_product(nets, obs, latent)(v))[:, 0]
    exact = trpo.dot(v, trpo.kl_hessian_product(nets, obs)(v))[:, 0]
    assert ((sampled - exact).abs() < 4 * error).all()
    assert (error < 0.1 * exact).all()


def test_conjugate_gradients_solve_what_a_dense_solver_solves() -> None:
    n = 12
    root = torch.randn(3, n, n, dtype=torch.float64)
    matrix = root @ root.mT + torch.eye(n).double() * torch.tensor([0.1, 1.0, 10.0]).double()[:, None, None]
    b = torch.randn(3, n, dtype=torch.float64)
    x = trpo.conjugate_gradient(
        lambda v: (matrix @ v[..., None])[..., 0], b, iterations=4 * n, tolerance=1e-24
    )
    assert torch.allclose(x, torch.linalg.solve(matrix, b), rtol=1e-6, atol=1e-8)


def test_a_step_does_not_depend_on_the_unit_of_the_advantages() -> None:
    run = small_run(small_config(algo="trpo", epochs=1))
    rollout = run.collector.collect(64)
    config = TRPOConfig(entropy_coef=0.0)
    whole, tiny = (
        trpo.natural_step(run.networks, rollout, unit * torch.ones_like(rollout.reward).cumsum(1), config)
        for unit in (1.0, 1e-7)
    )
    assert (torch.nn.functional.cosine_similarity(whole, tiny) > 0.999).all()
    assert torch.allclose(whole.norm(dim=1), tiny.norm(dim=1), rtol=0.02)


def test_conjugate_gradients_keep_seeds_apart() -> None:
    matrix = torch.diag(torch.tensor([1.0, 4.0, 9.0])).double()
    b = torch.tensor([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [torch.nan, 1.0, 1.0]], dtype=torch.float64)
    x = trpo.conjugate_gradient(lambda v: v @ matrix, b, iterations=10)
    assert torch.allclose(x[0], torch.tensor([1.0, 1 / 4, 1 / 9]).double())
    assert not x[1].any()  # nothing to solve, and no 0/0


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("fisher", ["hessian", "sampled"])
def test_a_step_improves_the_surrogate_within_the_trust_region(family: str, fisher: str) -> None:
    trainer, nets, rollout = started(family, horizon=128, hidden=(16,), fisher=fisher)
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    before, old = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)
    start = nets.actor.theta.clone()
    step = trpo.natural_step(nets, rollout, advantage, config)
    search = trpo.line_search(nets, rollout, advantage, step, config)
    after, new = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)
    assert search.accepted.all()
    assert (after > before).all()
    kl = nets.policy.law.kl(old, new).mean(1)
    assert (kl <= config.max_kl).all()
    assert (kl > 0.05 * config.max_kl).all()
    assert torch.allclose(nets.actor.theta, start + search.fraction[:, None] * step)


def test_the_full_step_has_the_length_of_the_trust_region() -> None:
    trainer, nets, rollout = started()
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    step = trpo.natural_step(nets, rollout, advantage, config)
    product = trpo.damped(trpo.kl_hessian_product(nets, rollout.obs), config.damping)
    assert torch.allclose(trpo.dot(step, product(step)) / 2, torch.full((2, 1), config.max_kl).double())


@pytest.mark.parametrize(
    ("fisher", "explicit"), [("hessian", explicit_hessian), ("sampled", explicit_fisher)]
)
@pytest.mark.parametrize("damping", [0.5, 3.0])
@pytest.mark.parametrize("iterations", [1, 2, 40])
def test_the_full_step_is_that_of_the_configuration(
    fisher: str, explicit: Callable, damping: float, iterations: int
) -> None:
    """k conjugate gradients minimise ½ xᵀAx − gᵀx over the span of g, Ag, …, Aᵏ⁻¹g; here by a dense solver."""
    numbers = {"fisher": fisher, "damping": damping, "cg_iters": iterations, "entropy_coef": 0.0}
    trainer, nets, rollout = started(**numbers)
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    step = trpo.natural_step(nets, rollout, advantage, config)
    gradient = explicit_gradient(nets, rollout, advantage)
    for s in range(2):
        matrix = explicit(nets, rollout, s)
        matrix = matrix + damping * torch.eye(len(matrix), dtype=matrix.dtype)
        if iterations == 40:  # more than there are weights
            x = torch.linalg.solve(matrix, gradient[s])
        else:
            span = torch.stack(
                [torch.linalg.matrix_power(matrix, k) @ gradient[s] for k in range(iterations)], 1
            )
            x = span @ torch.linalg.solve(span.T @ matrix @ span, span.T @ gradient[s])
        expected = (2 * config.max_kl / (x @ matrix @ x)).sqrt() * x
        assert torch.allclose(step[s], expected, rtol=1e-3, atol=1e-4 * float(expected.abs().max()))


@pytest.mark.parametrize("coefficient", [0.5, 0.8])
def test_the_search_shortens_by_its_factor_as_often_as_it_may(coefficient: float) -> None:
    trainer, nets, rollout = started(seeds=1, horizon=128, backtrack_coef=coefficient)
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    step = 6 * trpo.natural_step(nets, rollout, advantage, config)  # far too long
    start = nets.actor.theta.clone()
    before, old = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)

    def good(length: float) -> bool:
        nets.actor.theta.copy_(start + length * step)
        after, new = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)
        nets.actor.theta.copy_(start)
        return bool(after > before and nets.policy.law.kl(old, new).mean() <= config.max_kl)

    shortened = next(k for k in range(30) if good(coefficient**k))
    assert shortened >= 2
    for tries, fraction in (
        (shortened, 0.0),
        (shortened + 1, coefficient**shortened),
        (30, coefficient**shortened),
    ):
        some = dataclasses.replace(config, max_backtracks=tries)
        search = trpo.line_search(nets, rollout, advantage, step, some)
        assert search.accepted.tolist() == [fraction > 0]
        assert search.fraction.item() == pytest.approx(fraction)
        assert torch.allclose(nets.actor.theta, start + fraction * step)
        nets.actor.theta.copy_(start)


def test_a_step_that_is_good_is_taken_whole() -> None:
    trainer, nets, rollout = started(horizon=128)
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    before, old = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)
    start = nets.actor.theta.clone()
    step = trpo.natural_step(nets, rollout, advantage, config) / 2  # well within the trust region
    search = trpo.line_search(nets, rollout, advantage, step, config)
    assert search.fraction.tolist() == [1.0, 1.0]
    assert torch.equal(nets.actor.theta, start + step)
    after, new = trpo.surrogate(nets, rollout, advantage, config.entropy_coef)
    assert ((after > before) & (nets.policy.law.kl(old, new).mean(1) <= config.max_kl)).all()


def test_the_record_tells_which_seeds_step_was_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    sound = trpo.natural_step

    def downhill_for_the_first(*args) -> torch.Tensor:
        return sound(*args) * torch.tensor([[-1.0], [1.0], [1.0]])

    monkeypatch.setattr(trpo, "natural_step", downhill_for_the_first)
    record = small_run(small_config("trpo", epochs=1)).records[0]
    assert record["accepted"].tolist() == [0, 1, 1]
    assert record["step_fraction"][0] == 0
    assert (record["step_fraction"][1:] > 0).all()


def test_each_seeds_search_has_its_own_end() -> None:
    """One seed gets a step that is far too long, one a NaN, one a step downhill, one its own."""
    trainer, nets, rollout = started(seeds=4, horizon=128)
    config = trainer.config.algorithm
    advantage, _ = rollout.advantages(config.gamma, config.gae_lambda)
    step = trpo.natural_step(nets, rollout, advantage, config)
    start = nets.actor.theta.clone()
    changed = torch.stack([6 * step[0], torch.nan * step[1], -step[2], step[3]])
    search = trpo.line_search(nets, rollout, advantage, changed, config)
    assert search.accepted.tolist() == [True, False, False, True]
    assert 0 < search.fraction[0] < 1
    assert torch.equal(nets.actor.theta[1:3], start[1:3])
    alone = nets.actor.theta[3].clone()
    nets.actor.theta.copy_(start)
    trpo.line_search(nets, rollout, advantage, step, config)
    assert torch.equal(nets.actor.theta[3], alone)


@pytest.mark.parametrize("family", FAMILIES)
def test_it_learns(family: str) -> None:
    run = small_run(small_config("trpo", family, epochs=12, horizon=256, num_epochs=10, max_kl=0.03))
    first, last = run.records[0]["return_mean"].mean(), run.records[-1]["return_mean"].mean()
    assert last > 0.7 * first
    assert all((record["kl"] <= 0.03 + 1e-6).all() for record in run.records)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_kl": 0.0}, "max_kl must be positive"),
        ({"damping": -0.1}, "damping must not be negative"),
        ({"backtrack_coef": 1.5}, "backtrack_coef must lie in"),
        ({"fisher": "exact"}, "fisher must be hessian or sampled"),
        ({"minibatch_size": 60}, "must divide"),
    ],
)
def test_the_configuration_is_checked(wrong: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TRPOConfig(**wrong)
