"""The grader of *Which means and which spreads?* passes the right answer and names the known mistakes."""

from collections.abc import Callable

import pytest
import torch
from torch.distributions import Beta

from inbounds.book.exercises import beta_spread_and_region as graders


def moments(mean, std, low, high, cap):
    """By torch's own moments: bisection on the total, which sets the variance."""
    length = high - low
    m, smallest, largest = (mean - low) / length, 1e-6, 1e9
    for _ in range(200):
        total = (smallest * largest) ** 0.5
        law = Beta(torch.tensor(m * total, dtype=torch.float64), (1 - m) * total)
        if law.stddev.item() * length > std:
            smallest = total
        else:
            largest = total
    pair = m * total, (1 - m) * total
    return pair if min(pair) >= 1 and max(pair) <= cap else None


RIGHT = {"match_moments": moments}


def uncapped(mean, std, low, high, cap):
    return moments(mean, std, low, high, 1e9)


def unbounded(mean, std, low, high, cap):
    m, v = (mean - low) / (high - low), (std / (high - low)) ** 2
    total = m * (1 - m) / v - 1
    return None if max(m * total, (1 - m) * total) > cap else (m * total, (1 - m) * total)


def forgetting(mean, std, low, high, cap, alpha=True, beta=True, small_alpha=True, small_beta=True):
    """Right, but for one of the four conditions."""
    a, b = unbounded(mean, std, low, high, 1e9)
    tests = (alpha and a > cap, beta and b > cap, small_alpha and a < 1, small_beta and b < 1)
    return None if any(tests) else (a, b)


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("match_moments", lambda *a: moments(*a) and moments(*a)[::-1], "changed places"),
        (
            "match_moments",
            lambda m, s, lo, hi, c: moments((m - lo) / (hi - lo), s, 0, 1, c),
            "units of the action",
        ),
        ("match_moments", lambda *a: None, "refuse"),
        ("match_moments", lambda *a: (1.0, 1.0), "wrong α or β"),
        ("match_moments", unbounded, "below 1"),
        ("match_moments", uncapped, "above the cap"),
        ("match_moments", lambda m, s, lo, hi, c: moments(m, s, lo, hi, 80.0), "is an argument"),
        ("match_moments", lambda *a: forgetting(*a, alpha=False), "above the cap"),
        ("match_moments", lambda *a: forgetting(*a, beta=False), "above the cap"),
        ("match_moments", lambda *a: forgetting(*a, small_alpha=False), "below 1"),
        ("match_moments", lambda *a: forgetting(*a, small_beta=False), "below 1"),
    ],
)
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False, verdict
    assert words in verdict.message
