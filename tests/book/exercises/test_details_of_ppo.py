"""The grader of *What PPO's details change* passes right answers, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import details_of_ppo as graders


def running(reward, ended, gamma, cut, over=None, root=True, centre=False, resets=True):
    total, seen, out = 0.0, [], []
    for t, r in enumerate(reward):
        total = r + gamma * total
        seen.append(total if over is None else over[t])
        variance = np.mean(np.square(seen)) - np.mean(seen) ** 2
        scale = np.sqrt(max(variance, 0) + 1e-8) if root else np.sqrt(variance**2 + 1e-8)
        out.append(np.clip((r - centre * reward.mean()) / scale, -cut, cut))
        if ended[t] and resets:
            total = 0.0
    return np.array(out)


RIGHT = {"scaled_rewards": running}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *a: a[0], "nothing is scaled"),
        (lambda *a: running(*a, resets=False), "runs on across"),
        (lambda *a: running(*a, over=a[0]), "spread of the rewards"),
        (lambda *a: running(*a, centre=True), "centred"),
        (lambda *a: running(*a[:3], np.inf), "nothing is cut"),
        (lambda *a: running(*a, root=False), "square root is missing"),
        (lambda *a: running(*a) / 2, "some reward"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.scaled_rewards(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def test_a_look_into_the_future_is_named() -> None:
    def all_of_it(reward, ended, gamma, cut):
        total, sums = 0.0, []
        for r, end in zip(reward, ended, strict=True):
            total = r + gamma * total
            sums.append(total)
            total *= not end
        return np.clip(reward / np.sqrt(np.var(sums) + 1e-8), -cut, cut)

    assert "the future" in graders.scaled_rewards(all_of_it).message
