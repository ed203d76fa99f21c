"""The anchor: both sides are set to the same, its test is a test, and it goes on where it was."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from benchmarks import anchor, validate
from benchmarks.equivalence import seeds_needed_within
from benchmarks.published import RESULTS
from benchmarks.side_by_side import Job, our_config, peer_model
from inbounds.learning import TrainConfig, Trainer
from inbounds.learning.networks.normalizer import CLIP, EPSILON, RunningNormalizer
from inbounds.study import statistics

PROTOCOL = Path(__file__).parents[2] / "results" / "PROTOCOL-2.md"
EPOCHS = 5


def job(env: str, who: str, *seeds: int) -> Job:
    return Job(env, who, seeds, anchor.epochs_of(anchor.STEPS, 2048), 2048, True, Path())


@pytest.mark.parametrize("env", list(anchor.MARGINS))
def test_both_sides_are_set_to_the_same(env: str) -> None:
    peer, config = peer_model(job(env, anchor.PEER, 0)), our_config(job(env, anchor.OURS, 0))
    assert isinstance(config, TrainConfig)
    numbers = config.algorithm
    assert (peer.n_steps, peer.batch_size, peer.n_epochs) == (
        numbers.horizon,
        numbers.minibatch_size,
        numbers.num_epochs,
    )
    assert (peer.gamma, peer.gae_lambda) == (numbers.gamma, numbers.gae_lambda)
    assert {peer.clip_range(x) for x in (1.0, 0.5, 0.0)} == {numbers.clip_range}
    assert {peer.lr_schedule(x) for x in (1.0, 0.5, 0.0)} == {numbers.learning_rate}
    assert (peer.ent_coef, peer.vf_coef) == (numbers.entropy_coef, numbers.value_coef)
    assert (peer.max_grad_norm, peer.normalize_advantage) == (
        numbers.max_grad_norm,
        numbers.normalize_advantage,
    )
    assert peer.clip_range_vf is None
    assert peer.target_kl is None
    assert not peer.use_sde
    assert peer.policy.optimizer.defaults["eps"] == numbers.adam_eps
    ours = Trainer(config)
    assert peer.policy.optimizer.defaults["betas"] == ours.optimizer._adam.defaults["betas"]

    envs = peer.get_env()
    assert (envs.clip_obs, envs.epsilon, envs.norm_reward) == (CLIP, EPSILON, False)
    (robot,) = envs.unwrapped.envs
    assert robot.spec.max_episode_steps == ours.collector.envs.unwrapped.max_episode_steps == 1000
    assert robot.observation_space == ours.collector.envs.single_observation_space
    assert robot.action_space == ours.collector.envs.single_action_space
    assert config.action_mode == "clip"
    assert not peer.policy.squash_output
    same_start(peer, ours)


def same_start(peer, ours: Trainer) -> None:
    """Layers of one shape and of one scale; orthogonal rows or columns; no biases; σ = 1."""
    networks, act_dim = ours.networks, ours.networks.policy.act_dim
    theirs = {
        "policy": [peer.policy.mlp_extractor.policy_net[0], peer.policy.mlp_extractor.policy_net[2]],
        "value": [peer.policy.mlp_extractor.value_net[0], peer.policy.mlp_extractor.value_net[2]],
    }
    theirs["policy"].append(peer.policy.action_net)
    theirs["value"].append(peer.policy.value_net)
    for name, net in (("policy", networks.actor), ("value", networks.critic)):
        for layer, their in zip(net.layers, theirs[name], strict=True):
            weight = layer.weight[0].detach().numpy()
            weight = weight[:act_dim] if len(weight) == 2 * act_dim else weight
            scales = np.linalg.svd(weight, compute_uv=False)
            wanted = np.linalg.svd(their.weight.detach().numpy(), compute_uv=False)
            assert scales == pytest.approx(wanted, rel=1e-5)
            assert scales == pytest.approx(np.full_like(scales, scales[0]), rel=1e-5)
            assert not layer.bias.any()
            assert not their.bias.any()
    assert not peer.policy.log_std.any()
    assert not networks.actor.layers[-1].weight[0, act_dim:].any()


def test_the_statistics_differ_by_the_weight_of_a_ten_thousandth_of_an_observation() -> None:
    running = pytest.importorskip("stable_baselines3.common.running_mean_std").RunningMeanStd(shape=(3,))
    ours, rng = RunningNormalizer(1, 3, np.float64), np.random.default_rng(0)
    for n in range(1, 500):
        obs = rng.normal([[0.0, 5.0, -3.0]], [[1.0, 0.1, 20.0]])
        ours.update(obs)
        running.update(obs)
        scale = np.sqrt(ours.squares[0] / n)
        assert np.abs(running.mean - ours.mean[0]) == pytest.approx(0, abs=1e-4 * 60 / n)
        if n > 30:
            assert np.sqrt(running.var) == pytest.approx(scale, rel=0.1 * 30 / n)


def made_up(ours, theirs) -> pa.Table:
    """Return curves `[seeds, epochs]` of both sides on Ant, as they are kept."""
    parts = []
    for who, returns in ((anchor.OURS, ours), (anchor.PEER, theirs)):
        for seed, curve in enumerate(returns):
            steps = 2048 * np.arange(1, len(curve) + 1)
            names = {"env": ["Ant-v5"] * len(curve), "who": [who] * len(curve), "seed": [seed] * len(curve)}
            parts.append(pa.table(names | {"env_steps": steps, "return_mean": np.asarray(curve, float)}))
    return pa.concat_tables(parts)


def sides(gap: float, noise: float, n: int = 10) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    grows = np.linspace(-50, 400, EPOCHS) + rng.normal(size=(2, n, EPOCHS))
    levels = noise * rng.normal(size=(2, n, 1))
    levels -= levels.mean(1, keepdims=True) - np.array([gap, 0.0])[:, None, None]
    return tuple(grows + levels)


@pytest.mark.parametrize(
    ("gap", "noise", "word"),
    [
        (0, 100, "equivalent"),
        (150, 60, "equivalent"),
        (150, 200, "undecided"),
        (240, 60, "undecided"),
        (-270, 60, "undecided"),
        (400, 60, "different"),
        (-400, 60, "different"),
    ],
)
def test_the_word_is_that_of_two_one_sided_tests(gap: float, noise: float, word: str) -> None:
    ours, theirs = sides(gap, noise)
    verdict = anchor.judge(made_up(ours, theirs), "Ant-v5", 240)
    first, second = ours.mean(1), theirs.mean(1)
    p = max(
        stats.ttest_ind(first + 240, second, equal_var=False, alternative="greater").pvalue,
        stats.ttest_ind(first - 240, second, equal_var=False, alternative="less").pvalue,
    )
    assert verdict["p_value"] == pytest.approx(p)
    assert verdict["word"] == word
    for level in (90, 95):
        wanted = stats.ttest_ind(first, second, equal_var=False).confidence_interval(level / 100)
        assert verdict[f"interval_{level}"] == pytest.approx(list(wanted))
    assert word in anchor.sentence("Ant-v5", verdict)
    start = np.concatenate([ours[:, 0], theirs[:, 0]]).mean()
    assert verdict["start"] == pytest.approx(start)
    assert verdict[anchor.OURS]["gains"] == pytest.approx(first - start)


def test_a_seed_that_diverged_counts_with_its_last_return_and_one_without_any_is_missed() -> None:
    ours, theirs = sides(0, 50)
    ours[3, 2:] = np.nan
    verdict = anchor.judge(made_up(ours, theirs), "Ant-v5", 240)
    curve = [*ours[3, :2], *[ours[3, 1]] * 3]
    assert verdict[anchor.OURS]["gains"][3] == pytest.approx(np.mean(curve) - verdict["start"])
    theirs[0] = np.nan
    verdict = anchor.judge(made_up(ours, theirs), "Ant-v5", 240)
    assert verdict["word"] == "undecided"
    assert "undecided: " in anchor.sentence("Ant-v5", verdict)


def test_with_the_seeds_needed_it_succeeds_in_eight_of_ten_cases() -> None:
    rng = np.random.default_rng(3)
    n = seeds_needed_within(*200 * rng.normal(size=(2, 10_000)), margin=150)
    assert 28 <= n <= 33
    found = [statistics.equivalence(*200 * rng.normal(size=(2, n)), 150).equivalent for _ in range(300)]
    assert 0.7 < np.mean(found) < 0.9


def test_its_numbers_are_those_of_the_protocol() -> None:
    text = " ".join(
        PROTOCOL.read_text(encoding="utf8").partition("## An anchor outside")[2].partition("\n## ")[0].split()
    )
    on_ant, on_cheetah = re.findall(r"margin (\d+) on Ant and (\d+) on HalfCheetah", text)[0]
    assert {"Ant-v5": float(on_ant), "HalfCheetah-v5": float(on_cheetah)} == anchor.MARGINS
    assert "1 000 000 env steps, ten seeds a side" in text.replace("\N{NO-BREAK SPACE}", " ")
    chosen = anchor.parse([])
    assert chosen.seeds == 10
    assert 1_000_000 <= chosen.epochs * chosen.horizon < 1_000_000 + chosen.horizon
    assert chosen.engine == "compiled"  # the study's


def test_one_robot_or_the_other_engine_does_not_replace_what_is_stored() -> None:
    file = RESULTS / "anchor" / "anchor.json"
    stored = json.loads(file.read_text())
    same = {name: stored[name] for name in ("engine", "seeds", "env_steps")}
    assert validate.place_beside(file, same) == (file.parent, "")
    for change in (
        {"seeds": {"Ant-v5": 10}},
        {"seeds": dict.fromkeys(anchor.MARGINS, 5)},
        {"engine": "autograd"},
    ):
        assert validate.place_beside(file, same | change)[0] == RESULTS / "some" / "anchor"


@pytest.mark.slow
def test_a_quick_anchor_judges_and_goes_on_where_it_was(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(anchor.os, "nice", lambda _: 0)  # or the rest of the tests would be slow
    quick = ["--quick", "--envs", "HalfCheetah-v5", "--engine", "autograd", "--output", str(tmp_path)]
    anchor.main([*quick, "--workers", "1"])
    folder = tmp_path / "quick"
    results = json.loads((folder / "anchor.json").read_text())
    verdict = results["verdicts"]["HalfCheetah-v5"]
    assert [len(verdict[who]["gains"]) for who in (anchor.OURS, anchor.PEER)] == [2, 2]
    assert verdict["margin"] == 860
    assert (folder / "anchor.svg").stat().st_size > 1000

    monkeypatch.setattr(anchor, "run_jobs", lambda *_: pytest.fail("everything is there"))
    anchor.main(quick)
    assert "HalfCheetah-v5: " in capsys.readouterr().out
    left = []
    next(folder.glob(f"runs/HalfCheetah-v5-{anchor.PEER}-*-1.parquet")).unlink()
    monkeypatch.setattr(anchor, "run_jobs", lambda todo, *_: left.extend(todo))
    with pytest.raises(FileNotFoundError):  # nobody has trained it
        anchor.main(quick)
    assert [(each.who, each.seeds) for each in left] == [(anchor.PEER, (1,))]
