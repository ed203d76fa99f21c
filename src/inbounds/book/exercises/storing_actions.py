"""Grader of the chapter *Storing and evaluating actions safely* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def bits_for(function: Callable[..., Any]) -> Judgement:
    """The fewest significant bits of a stored action on [−1, 1] that keep every latent up to z finite."""

    def case(z: float) -> Case:
        right = math.ceil(math.log2(1 + math.exp(z)) - 2)  # (1 + e^z) / 4 ≤ 2^b
        mistakes = {
            "two bits too many: rounding reaches half a spacing, and the distance from the bound is 2/(1 + e^z)": right
            + 2,
            "one bit too many: a record is lost below *half* a spacing, not below a whole one": right + 1,
            "one bit too few: round up, for the largest latent must still be kept": right - 1,
            "those are decimal digits: a bit is worth log 2 of latent, a digit log 10": math.ceil(
                (z - math.log(4)) / math.log(10)
            ),
            "that is the latent itself in bits: divide by log 2": math.ceil(z - 2),
        }
        return Case((z,), right, mistakes)

    cases = [case(z) for z in (5.0, 18.0, 18.1, 30.0, 40.0)]
    return judge_cases(function, cases, "right, on both sides of single precision's limit")
