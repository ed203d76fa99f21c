"""The checks of environments let right ones pass, each stops what it is there for, and the graders name mistakes."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from inbounds import robots
from inbounds.book.exercises import your_own_environment as graders
from inbounds.book.exercises.checks.environment import CHECKS, complaints
from tests.learning.point import PointEnv


class Amnesic(PointEnv):
    def reset(self, *, seed=None, options=None):
        self.draws = getattr(self, "draws", 0) + 1
        return super().reset(seed=None if seed is None else [self.draws + s for s in seed])


class Chatty(PointEnv):
    """Its points pull each other."""

    def step(self, actions):
        return super().step(actions + 0.01 * self.x.mean(0))


class Crowd(PointEnv):
    """Its points draw their starts from one generator."""

    def reset(self, *, seed=None, options=None):
        return super().reset(seed=None if seed is None else [sum(seed) + i for i in range(len(seed))])


class Recycled(PointEnv):
    def step(self, actions):
        obs, *rest = super().step(actions)
        self.seen = getattr(self, "seen", obs)
        self.seen[:] = obs
        return self.seen, *rest


class HalfBlind(PointEnv):
    def step(self, actions):
        return super().step(np.maximum(actions, 0))


class Forgetful(PointEnv):
    def step(self, actions):
        obs, *rest, info = super().step(actions)
        return obs, *rest, {"final_obs": obs} if info else info


class Coarse(PointEnv):
    """Sound, and with so few observations that the last of an episode may well be the first of the next."""

    def step(self, actions):
        obs, *rest, info = super().step(actions)
        if "final_obs" in info:
            final = [None if one is None else self.seen_as(one) for one in info["final_obs"]]
            info = info | {"final_obs": np.array([*final, None], object)[:-1]}
        return self.seen_as(obs), *rest, info

    def reset(self, *, seed=None, options=None):
        obs, info = super().reset(seed=seed, options=options)
        return self.seen_as(obs), info

    @staticmethod
    def seen_as(obs):
        return np.sign(obs) * [1, 1, 0]


class Silent(PointEnv):
    def step(self, actions):
        return *super().step(actions)[:-1], {}


class Clockless(PointEnv):
    def step(self, actions):
        obs, reward, terminated, truncated, info = super().step(actions)
        return obs, reward, terminated | truncated, np.zeros_like(truncated), info


class BothFlags(PointEnv):
    def step(self, actions):
        obs, reward, terminated, truncated, info = super().step(actions)
        return obs, reward, terminated | truncated, truncated, info


class Patient(Clockless):
    """Its clock runs for 1000 steps, and a small box lets no point escape before."""

    def __init__(self, num_envs: int) -> None:
        super().__init__(num_envs, low=(-0.4, -0.4), high=(0.4, 0.4))

    def _start(self, i: int) -> None:
        super()._start(i)
        self.elapsed[i] = -980


class DeadTime(PointEnv):
    """An action is felt four steps later."""

    def step(self, actions):
        self.waiting = [np.where(self.elapsed[:, None] > k, self.waiting[k], 0) for k in range(4)]
        self.waiting = [actions, *self.waiting]
        return super().step(self.waiting.pop())

    def reset(self, **options):
        self.waiting = [np.zeros((self.num_envs, 2))] * 4
        return super().reset(**options)


class Throw(PointEnv):
    """Over after one step, in which everything happens."""

    def step(self, actions):
        obs, reward, terminated, truncated, info = super().step(actions)
        return obs, reward, truncated, terminated & False, info

    def _start(self, i: int) -> None:
        super()._start(i)
        self.elapsed[i] = 19


class Summed(PointEnv):
    def step(self, actions):
        obs, reward, *rest = super().step(actions)
        return obs, reward.sum(), *rest


class Elsewhere(PointEnv):
    def step(self, actions):
        obs, *rest = super().step(actions)
        return obs[:, :2], *rest


BROKEN = {
    Summed: "spaces",
    Elsewhere: "spaces",
    Amnesic: "seeds",
    Chatty: "neighbours",
    Crowd: "neighbours",
    Recycled: "own copies",
    HalfBlind: "bounds",
    Forgetful: "final observation",
    Silent: "final observation",
    Clockless: "time limit",
    BothFlags: "time limit",
    Patient: "time limit",
}


@pytest.mark.parametrize(
    "make", [PointEnv, DeadTime, Throw, lambda n: PointEnv(n, low=(-1, -0.5), high=(1, 2))]
)
def test_a_sound_environment_passes(make: Callable) -> None:
    assert complaints(make) == {}
    assert graders.own_environment(make).passed is True


def test_an_environment_of_one_seed_is_told_the_way() -> None:
    verdict = graders.own_environment(lambda num_envs: gymnasium.make("Pendulum-v1"))
    assert verdict.passed is False
    assert "training takes a vector environment" in verdict.message


def test_a_coincidence_is_no_fault() -> None:
    assert "final observation" not in complaints(Coarse)


@pytest.mark.slow
def test_the_robots_pass() -> None:
    assert complaints(lambda n: robots.make("Hopper-v5", n)) == {}


@pytest.mark.parametrize(("broken", "check"), BROKEN.items(), ids=lambda x: getattr(x, "__name__", x))
def test_each_fault_is_stopped_by_its_check_first(broken: Callable, check: str) -> None:
    assert next(iter(complaints(broken))) == check
    verdict = graders.own_environment(broken)
    assert verdict.passed is False
    assert f'"{check}"' in verdict.message


def test_the_reason_is_said() -> None:
    said = {kind.__name__: complaints(kind)[check] for kind, check in BROKEN.items()}
    assert "lower half of its interval [-1, 1]" in said["HalfBlind"]
    assert "longer than 20 steps" in said["Clockless"]
    assert "first observation of the next" in said["Forgetful"]
    assert "without info['final_obs']" in said["Silent"]
    assert "neighbours have other seeds" in said["Crowd"]
    assert "neighbours act otherwise" in said["Chatty"]
    assert "array of shape [N]" in said["Summed"]
    assert "not one of Box" in said["Elsewhere"]


def test_a_reset_in_another_step_is_refused_with_the_fix() -> None:
    class NextStep(PointEnv):
        def __init__(self, num_envs: int) -> None:
            super().__init__(num_envs)
            self.metadata = {"autoreset_mode": "NextStep"}

    assert "SAME_STEP" in complaints(NextStep)["spaces"]


def test_the_diagnosis() -> None:
    answers: dict[Any, Any] = dict(BROKEN)
    broken = {kind: kind for kind in BROKEN}
    assert graders.diagnosis(answers, broken).passed is True
    verdict = graders.diagnosis(answers | {Clockless: "seeds"}, broken)
    assert verdict.passed is False
    assert "gets past that one" in verdict.message
    verdict = graders.diagnosis(answers | {Amnesic: "time limit"}, broken)
    assert "an earlier check" in verdict.message
    verdict = graders.diagnosis(answers | {Amnesic: "amnesia"}, broken)
    assert all(name in verdict.message for name in CHECKS)


def value(gamma: float, steps: int) -> float:
    return (1 - gamma * (1 - gamma**steps) / (steps * (1 - gamma))) / (1 - gamma)


def test_a_right_value_passes_and_none_is_no_failure() -> None:
    assert graders.value_under_a_clock(value).passed is True
    assert graders.value_under_a_clock(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda g, n: 1 / (1 - g), "without a clock"),
        (lambda g, n: (1 - g**n) / (1 - g), "first step"),
        (lambda g, n: (value(g, n) - 1) / g, "one step is missing"),
        (lambda g, n: 1 + g * value(g, n), "too many"),
        (lambda g, n: n * value(g, n), "divide by N"),
        (lambda g, n: 1 - (1 - g) * value(g, n), "shortfall"),
    ],
)
def test_mistakes_about_the_clock_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.value_under_a_clock(wrong)
    assert verdict.passed is False
    assert words in verdict.message
