"""Graders of the chapter *What next* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def command(function: Callable[..., Any]) -> Judgement:
    """The command of a squashed latent within the motor's box and its rate limit."""

    def case(z: float, last: float, rate: float, hint: str) -> Case:
        low, high = max(-1.0, last - rate), min(1.0, last + rate)
        half, middle = (high - low) / 2, (high + low) / 2
        right = middle + half * math.tanh(z / 2)
        known = {
            "that is the fixed box's command, cut by the rate limit: squash into the box of this step": min(
                max(math.tanh(z / 2), low), high
            ),
            "the motor's own bounds are missing: the rate limit alone leaves [−1, 1] near its ends": last
            + rate * math.tanh(z / 2),
            "this book's squash is the logistic one: tanh(z/2), not tanh(z)": middle + half * math.tanh(z),
            "the latent is squashed to [0, 1], and has to be stretched to the box": 1 / (1 + math.exp(-z)),
        }
        mistakes = {said: wrong for said, wrong in known.items() if not math.isclose(wrong, right)}
        return Case((z, last, rate), right, mistakes, hint)

    cases = [
        case(0.7, 0.1, 0.2, "the box of this step reaches from last − rate to last + rate"),
        case(-1.5, -0.95, 0.2, "near −1 the box is shorter: the motor's bound cuts it"),
        case(2.0, 0.9, 0.5, "near 1, too"),
        case(0.0, 0.0, 3.0, "a rate limit that never binds leaves the motor's box"),
    ]
    return judge_cases(function, cases, "right: within the box and the rate, and nothing is cut")
