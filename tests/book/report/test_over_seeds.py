"""Intervals over seeds as the chapters write them: against SciPy's, and repeatable."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy import stats

from inbounds.book.drawing import figures
from inbounds.book.report.over_seeds import draw, final_policies, mean_of, minus
from inbounds.study import grid
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics import difference
from inbounds.study.statistics.settings import MANY_RESAMPLES
from inbounds.study.store import StudyFolder


def test_a_mean_has_about_students_interval() -> None:
    values = np.random.default_rng(1).normal(5.0, 2.0, 40)
    found, student = mean_of(values), stats.ttest_1samp(values, 0.0).confidence_interval()
    assert found.value == pytest.approx(values.mean())
    assert (found.low, found.high) == pytest.approx((student.low, student.high), rel=0.03)
    assert mean_of(values) == found


def test_a_difference_has_about_welchs_interval() -> None:
    rng = np.random.default_rng(2)
    first, second = rng.normal(5.0, 2.0, 40), rng.normal(3.0, 1.0, 30)
    found = minus(first, second)
    welch = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    assert found.value == pytest.approx(first.mean() - second.mean())
    assert (found.low, found.high) == pytest.approx((welch.low, welch.high), rel=0.05)
    turned = minus(second, first)
    assert (turned.value, turned.low, turned.high) == (-found.value, -found.high, -found.low)


def test_many_resamples_settle_on_which_side_of_zero_an_interval_ends() -> None:
    """With another seed of the resampling the end hardly moves."""
    rng = np.random.default_rng(3)
    first, second = rng.normal(5.0, 2.0, 10), rng.normal(3.0, 1.0, 10)
    found = minus(first, second)
    rng = np.random.default_rng(1)
    again = difference(first, second, rng, statistic="mean", resamples=MANY_RESAMPLES)
    assert MANY_RESAMPLES >= 100_000
    assert found.low != again.low
    assert abs(found.low - again.low) < 0.02 * (found.high - found.low)


def test_a_curve_is_drawn_where_the_study_measures() -> None:
    fig, ax = plt.subplots()
    values = np.arange(51.0) + np.random.default_rng(0).normal(size=(10, 51))
    draw(ax, "beta", values, linestyle=":")
    (line,), (band,) = ax.lines, ax.collections
    assert line.get_xdata().tolist() == [1, *range(10, 501, 10)]
    np.testing.assert_allclose(line.get_ydata(), values.mean(0))
    assert line.get_linestyle() == ":"
    assert line.get_color() == figures.family_style("beta")["color"]
    corners = band.get_paths()[0].vertices
    assert corners[:, 1].min() < values.mean(0)[0]
    plt.close(fig)


def test_an_arm_that_keeps_no_policies_has_none_to_load() -> None:
    outcomes = Outcomes.read(StudyFolder(), grid.select(["mechanisms-hopper-ppo-beta-entropy-0"]))
    (outcome,) = outcomes.finished.values()
    with pytest.raises(FileNotFoundError, match="arm mechanisms keeps no policies"):
        final_policies(outcomes, outcome)
