import dataclasses

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from inbounds.learning import Collector, Rollout, Trainer
from tests.learning.point import PointEnv
from tests.learning.small import FAMILIES, small_config

HORIZON = 128


def collector(family: str = "gaussian", **options) -> Collector:
    env = {key: options.pop(key) for key in ("low", "high", "poisoned", "squash") if key in options}
    config = small_config(family=family, dtype="float64", **options)
    return Trainer(config, lambda n: PointEnv(n, **env)).collector


def replay(rollout: Rollout, seeds: list[int], **env) -> list[tuple]:
    """The same actions in a fresh world, step by step."""
    world = PointEnv(len(seeds), **env)
    obs, _ = world.reset(seed=seeds)
    steps = []
    for t in range(rollout.horizon):
        following, *rest = world.step(rollout.action[:, t].numpy())
        steps.append((obs, following, *rest))
        obs = following
    return steps


@pytest.mark.parametrize("family", FAMILIES)
def test_a_rollout_is_what_happened(family: str) -> None:
    acting = collector(family, normalize_obs=False, low=(-1.0, -0.5), high=(1.0, 2.0))
    seeds = [stream.environment for stream in acting.streams]
    rollout = acting.collect(HORIZON)
    steps = replay(rollout, seeds, low=(-1.0, -0.5), high=(1.0, 2.0))
    returns, running = [[] for _ in seeds], np.zeros(len(seeds))
    for t, (obs, following, reward, terminated, truncated, info) in enumerate(steps):
        assert np.array_equal(rollout.obs[:, t], obs)
        assert np.array_equal(rollout.reward[:, t], reward)
        assert np.array_equal(rollout.terminated[:, t], terminated)
        assert np.array_equal(rollout.truncated[:, t], truncated)
        running += reward
        for s in np.flatnonzero(terminated | truncated):
            returns[s].append(running[s])
            running[s] = 0
        after = torch.tensor(following)
        for s in np.flatnonzero(truncated):
            after[s] = torch.from_numpy(info["final_obs"][s])
        value = acting.networks.values(after[:, None])[:, 0].detach()
        expected = value * torch.from_numpy(truncated | (t == HORIZON - 1))
        assert torch.allclose(rollout.bootstrap[:, t], expected, atol=1e-12)
    assert rollout.truncated.any()
    assert [[float(r) for r in rs] for rs in returns] == [list(r) for r in rollout.episode_returns]


def test_an_episode_cut_off_by_the_last_step_is_worth_its_own_final_observation() -> None:
    acting = collector("beta", normalize_obs=False)
    seeds = [stream.environment for stream in acting.streams]
    rollout = acting.collect(40)  # two episodes of twenty steps
    _, following, *_, info = replay(rollout, seeds)[-1]
    final = np.stack(list(info["final_obs"]))
    own, next_episodes = (
        acting.networks.values(torch.from_numpy(x)[:, None])[:, 0] for x in (final, following)
    )
    assert rollout.truncated[:, -1].all()
    assert torch.allclose(rollout.bootstrap[:, -1], own, atol=1e-12)
    assert ((own - next_episodes).abs() > 1e-3).all()


def test_an_environment_that_hides_the_final_observation_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    acting = collector("beta")
    step = acting.envs.step
    monkeypatch.setattr(acting.envs, "step", lambda actions: (*step(actions)[:4], {}))
    with pytest.raises(ValueError, match=r"no info\['final_obs'\].*SAME_STEP"):
        acting.collect(40)


@pytest.mark.parametrize("family", FAMILIES)
def test_actions_come_from_latents_and_log_probs_belong_to_them(family: str) -> None:
    acting = collector(family, low=(-1.0, -0.5), high=(1.0, 2.0))
    rollout = acting.collect(HORIZON)
    policy = acting.policy
    box = np.clip(policy.action(rollout.latent.numpy()), policy.low, policy.high)
    assert np.array_equal(rollout.action, box)
    parameters = acting.networks.parameters(rollout.obs)
    assert torch.equal(rollout.log_prob, policy.law.log_prob(parameters, rollout.latent))
    for stored, found in zip(rollout.parameters, parameters, strict=True):
        assert torch.equal(stored, found)
    unit = (box - policy.centre) / policy.half_range
    assert np.allclose(rollout.saturation, (np.abs(unit) > 0.999).mean((1, 2)))
    assert (rollout.saturation > 0.1).all() == (family in ("gaussian", "clipped-gaussian"))
    assert np.allclose(rollout.action_std, np.sqrt(unit.var(1).mean(1)))


def test_raw_actions_leave_the_box_and_clipped_ones_do_not() -> None:
    raw, clipped = (collector(action_mode=mode).collect(HORIZON) for mode in ("raw", "clip"))
    assert raw.action.abs().max() > 1
    assert clipped.action.abs().max() == 1
    executed = raw.action.clamp(-1, 1).numpy()  # the spread of what the motors do, whatever is charged
    assert np.allclose(raw.action_std, np.sqrt(executed.var(1).mean(1)))


def test_an_environment_that_clips_takes_no_raw_actions() -> None:
    config = dataclasses.replace(small_config(seeds=2), env="Hopper-v5")
    of = Trainer(config).collector
    with pytest.raises(ValueError, match="make the environments with it, too"):
        Collector(of.envs, of.networks, of.streams, True, "raw")


def test_observations_are_normalised_by_what_was_seen_so_far() -> None:
    acting = collector()
    seeds = [stream.environment for stream in acting.streams]
    rollout = acting.collect(HORIZON)
    seen = np.stack([obs for obs, *_ in replay(rollout, seeds)], 1)  # [S, T, O]
    for t in (1, 17, 100):
        past = seen[:, : t + 1]
        expected = (seen[:, t] - past.mean(1)) / np.sqrt(past.var(1) + 1e-8)
        assert np.allclose(rollout.obs[:, t], expected.clip(-10, 10), atol=1e-9)


def test_episodes_go_on_from_one_rollout_to_the_next() -> None:
    acting = collector(normalize_obs=False)
    seeds = [stream.environment for stream in acting.streams]
    first, second = acting.collect(50), acting.collect(HORIZON - 50)  # ten steps into the third episode
    obs, action, reward, truncated = (
        torch.cat([getattr(half, name) for half in (first, second)], 1)
        for name in ("obs", "action", "reward", "truncated")
    )
    steps = replay(dataclasses.replace(first, action=action, reward=reward), seeds)
    for t, (seen, _, rewarded, _, cut, _) in enumerate(steps):
        assert np.array_equal(obs[:, t], seen)
        assert np.array_equal(reward[:, t], rewarded)
        assert np.array_equal(truncated[:, t], cut)
    assert truncated[:, 59].all()  # episodes of twenty steps
    assert not truncated[:, 50:59].any()
    across = reward[:, 40:60].sum(1).tolist()
    assert [returns[0] for returns in second.episode_returns] == pytest.approx(across)


def test_a_seed_of_a_rollout_is_a_copy() -> None:
    rollout = collector().collect(30)
    one = rollout.seed(-1)
    assert torch.equal(one.obs, rollout.obs[2:])
    assert one.episode_returns == rollout.episode_returns[2:]
    before = rollout.saturation.copy(), rollout.action_std.copy(), rollout.obs.clone()
    for array in (one.saturation, one.action_std, one.obs):
        array[:] = -1
    assert rollout.saturation.tolist() == before[0].tolist()
    assert rollout.action_std.tolist() == before[1].tolist()
    assert torch.equal(rollout.obs, before[2])
    with pytest.raises(IndexError, match="no seed 3: choose one of the 3"):
        rollout.seed(3)


def test_a_poisoned_seed_holds_still() -> None:
    rollout = collector("beta", poisoned=(1,)).collect(30)
    assert torch.isnan(rollout.latent[1]).all()
    assert not rollout.action[1].any()  # the middle of the box
    assert torch.isfinite(rollout.log_prob[[0, 2]]).all()


def test_a_readers_own_gymnasium_environment() -> None:
    def make(n: int) -> SyncVectorEnv:
        return SyncVectorEnv(
            [lambda: gymnasium.make("Pendulum-v1")] * n, autoreset_mode=AutoresetMode.SAME_STEP
        )

    trainer = Trainer(small_config(seeds=2, horizon=256, epochs=1), make)
    record = trainer.epoch()
    assert record["episodes"].tolist() == [1, 1]
    assert (record["return_mean"] < -100).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda n: SyncVectorEnv([lambda: gymnasium.make("Pendulum-v1")] * n), "SAME_STEP"),
        (lambda n: PointEnv(n + 1), "make 3 instead of 4"),
        (
            lambda n: SyncVectorEnv(
                [lambda: gymnasium.make("CartPole-v1")] * n, autoreset_mode=AutoresetMode.SAME_STEP
            ),
            "one-dimensional Box",
        ),
        (
            lambda n: SyncVectorEnv(
                [
                    lambda: gymnasium.wrappers.TransformAction(
                        gymnasium.make("Pendulum-v1"), lambda a: a, gymnasium.spaces.Box(0, 3, (1,), np.int64)
                    )
                ]
                * n,
                autoreset_mode=AutoresetMode.SAME_STEP,
            ),
            "real numbers.*cut off.*round.*TransformAction",
        ),
        (
            lambda n: SyncVectorEnv(
                [
                    lambda: gymnasium.wrappers.TransformObservation(
                        gymnasium.make("Pendulum-v1"), lambda obs: 3, gymnasium.spaces.Discrete(5)
                    )
                ]
                * n,
                autoreset_mode=AutoresetMode.SAME_STEP,
            ),
            "observations must be a Box, and no images, got Discrete.*FlattenObservation",
        ),
        (
            lambda n: SyncVectorEnv(
                [
                    lambda: gymnasium.wrappers.TransformObservation(
                        gymnasium.make("Pendulum-v1"),
                        lambda obs: np.zeros((8, 8, 3), np.uint8),
                        gymnasium.spaces.Box(0, 255, (8, 8, 3), np.uint8),
                    )
                ]
                * n,
                autoreset_mode=AutoresetMode.SAME_STEP,
            ),
            r"no images, got Box\(0, 255, \(8, 8, 3\), uint8\).*perceptrons.*FlattenObservation.*stable-baselines3",
        ),
    ],
)
def test_environments_that_cannot_work_are_refused_with_the_fix(make, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Trainer(small_config(), make)
