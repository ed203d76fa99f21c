"""A forest draws the numbers it is given, in their unit, and keeps the robots' order."""

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest

from inbounds.book.report.forests import MARGINS_AS_UNIT, SERIES, Bar, forest, in_words
from inbounds.book.report.study_panels import NARROW
from inbounds.study.analysis import CONTRASTS
from inbounds.study.grid import ARMS
from tests.book.report.made_up import gap


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    plt.close("all")


BARS = {
    "PPO": [
        Bar("Ant", "beta", gap(100, 300), 100.0),
        Bar("Ant", "logit-normal", gap(-50, 50), 100.0, hollow=True),
    ],
    "TRPO": [Bar("Hopper", "beta", gap(-8, -4), 4.0)],
}


def test_bars_stand_in_their_units() -> None:
    fig = forest(BARS, xlabel="in margins", order=["Hopper", "Ant"])
    ppo, trpo = fig.axes
    assert [label.get_text() for label in ppo.get_yticklabels()] == ["Hopper", "Ant"]
    lines = [
        line
        for line in ppo.lines
        if len(line.get_xdata()) == 2 and line.get_xdata()[0] != line.get_xdata()[1]
    ]
    assert [list(line.get_xdata()) for line in lines] == [[1.0, 3.0], [-0.5, 0.5]]
    assert all(round(float(np.mean(line.get_ydata()))) == 1 for line in lines)
    (bar,) = [
        line
        for line in trpo.lines
        if len(line.get_xdata()) == 2 and line.get_xdata()[0] != line.get_xdata()[1]
    ]
    assert list(bar.get_xdata()) == [-2.0, -1.0]
    assert round(float(np.mean(bar.get_ydata()))) == 0


def test_on_a_phone_the_panels_stand_below_each_other_and_fit() -> None:
    panels = {"final return": BARS["PPO"], "area under the learning curve": BARS["TRPO"]}
    wide, narrow = (forest(panels, xlabel=MARGINS_AS_UNIT, narrow=n) for n in (False, True))
    assert narrow.get_size_inches()[0] == NARROW
    for ax, same in zip(narrow.axes, wide.axes, strict=True):
        assert [list(line.get_xdata()) for line in ax.lines] == [
            list(line.get_xdata()) for line in same.lines
        ]
    narrow.draw_without_rendering()
    renderer = narrow.canvas.get_renderer()
    boxes = [ax.get_tightbbox(renderer) for ax in narrow.axes]
    boxes += [each.get_window_extent(renderer) for each in (*narrow.legends, *narrow.texts)]
    for box in boxes:
        assert box.x0 >= 0
        assert box.x1 <= narrow.bbox.width
    upper, lower = (ax.get_window_extent(renderer) for ax in narrow.axes)
    assert upper.y0 > lower.y1


def test_a_hollow_bar_is_hollow() -> None:
    markers = [line for line in forest(BARS, xlabel="x").axes[0].lines if line.get_marker() in "^o"]
    assert [line.get_markerfacecolor() for line in markers] == [SERIES["beta"].color, "white"]


def test_no_two_series_of_a_figure_look_alike() -> None:
    shown = {name: each for name, each in SERIES.items() if name != "logit-normal, clipped-gaussian"}
    assert len({(series.color, series.marker) for series in shown.values()}) == len(shown)
    for arm in ARMS:
        pairs = {(c.first, c.second) for c in CONTRASTS if c.arm == arm}
        assert not {("logit-normal", "gaussian"), ("logit-normal", "clipped-gaussian")} <= pairs


def test_nothing_to_draw() -> None:
    with pytest.raises(ValueError, match="nothing to draw"):
        forest({"PPO": []}, xlabel="x")


def test_words_have_every_number() -> None:
    told = in_words(BARS)
    assert "Ant, Beta − Gaussian: 200 [100, 300]" in told
    assert "TRPO: Hopper, Beta − Gaussian: −6.0 [−8.0, −4.0]" in told
