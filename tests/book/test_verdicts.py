"""A verdict comes from its interval: no word can disagree with the number beside it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inbounds.book import verdicts
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.words import side
from inbounds.study.words import verdict as after_holm

finite = st.floats(-1e6, 1e6)


def estimate(low: float, value: float, high: float) -> Estimate:
    return Estimate(np.array(value), np.array(low), np.array(high), 10, 0, 0.95, "difference of means")


@given(finite, finite, finite)
def test_the_word_is_the_intervals_side(a: float, b: float, against: float) -> None:
    low, high = sorted((a, b))
    found = verdicts.verdict((low, (low + high) / 2, high), against)
    assert (found == "above") is (low > against)
    assert (found == "below") is (high < against)
    assert found.startswith("no difference found") is (low <= against <= high)


@given(finite, finite)
def test_the_report_and_the_pages_never_disagree(a: float, b: float) -> None:
    low, high = sorted((a, b))
    gap = estimate(low, (low + high) / 2, high)
    word = {1: "higher", -1: "lower", 0: "unresolved"}[side(low, high)]
    assert after_holm(Comparison(gap, 0.001, 0.001)) == word
    assert verdicts.verdict(gap).startswith({1: "above", -1: "below", 0: "no difference"}[side(low, high)])


def test_an_open_interval_says_what_it_leaves_possible() -> None:
    found = verdicts.verdict(estimate(-77, -9, 59), digits=0, unit=" points")
    assert found == "no difference found (effects between −77 and 59 points remain possible)"
    assert verdicts.verdict((0.9, 0.93, 0.96), 0.95, digits=2).endswith(
        "(effects between −0.05 and 0.01 remain possible)"
    )


def test_a_bound_that_touches_is_no_finding() -> None:
    assert verdicts.verdict((0.0, 1.0, 2.0)).startswith("no difference")
    assert verdicts.told((-2.0, -1.0, 0.0), digits=0) == "−1 [−2, 0], no difference found"


@pytest.mark.parametrize("ends", [(1.0, 0.5, 0.0), (float("nan"), 0.0, 1.0), (0.0, 1.0, float("inf"))])
def test_what_is_no_interval_is_refused(ends: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="lower end, value, upper end"):
        verdicts.verdict(ends)
