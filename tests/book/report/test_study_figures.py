"""The study's figures: they show the numbers given, say what the band is, and hide nothing that is missing."""

import dataclasses
from collections.abc import Iterator

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS, WIDTH, png_bytes
from inbounds.book.report import study_figures
from inbounds.book.report.study_figures import Curve
from inbounds.book.report.study_panels import NARROW
from inbounds.study import statistics

ROBOTS = ["HalfCheetah-v5", "Hopper-v5", "Swimmer-v5", "Walker2d-v5", "Ant-v5", "Humanoid-v5"]
STEPS = 2048.0 * np.arange(1, 31)


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    before = dict(mpl.rcParams)
    yield
    plt.close("all")
    assert dict(mpl.rcParams) == before, "a figure left its style behind"


def scores(place: int, robot: int = 0) -> np.ndarray:
    return np.random.default_rng([place, robot]).normal(100 * (1 + place), 30, 10)


def estimate(values: np.ndarray, **settings: str) -> statistics.Estimate:
    return statistics.bootstrap(values, np.random.default_rng(0), resamples=300, **settings)


def curve(place: int, diverged: int = 0, robot: int = 0) -> Curve:
    rng = np.random.default_rng([place, robot])
    returns = scores(place, robot)[:, None] * (1 - np.exp(-STEPS / 2e4)) + rng.normal(0, 9, (10, len(STEPS)))
    returns[:diverged, 20:] = np.nan
    return Curve(STEPS, statistics.learning_curve(returns, rng, resamples=200, missing="exclude"))


def words(fig: Figure) -> str:
    """Everything that can be read in a figure, line breaks as spaces."""
    fig.draw_without_rendering()
    found = fig.findobj(mpl.text.Text)
    return " | ".join(" ".join(text.get_text().split()) for text in found if text.get_visible())


def test_every_panel_draws_the_curves_and_bands_it_was_given() -> None:
    cells = {robot: {f: curve(i, robot=r) for i, f in enumerate(LOOKS)} for r, robot in enumerate(ROBOTS)}
    fig = study_figures.learning_curves(cells)
    assert [ax.get_title() for ax in fig.axes] == ROBOTS
    for ax, robot in zip(fig.axes, ROBOTS, strict=True):
        assert len(ax.collections) == len(LOOKS)
        for line, band, (family, given) in zip(ax.lines, ax.collections, cells[robot].items(), strict=True):
            look = LOOKS[family]
            assert np.array_equal(line.get_xydata(), np.stack([STEPS / 1e6, given.estimate.value], -1))
            assert (to_hex(line.get_color()), line.get_linestyle()) == (look.color.lower(), look.linestyle)
            assert line.get_marker() == look.marker
            outline = band.get_paths()[0].vertices
            assert outline[:, 1].min() == given.estimate.low.min()
            assert outline[:, 1].max() == given.estimate.high.max()
    said = words(fig)
    assert "Line: mean. Band: 95 % bootstrap interval, at each epoch by itself. n = 10 seeds." in said
    for text in [
        "return",
        "env steps per seed [millions]",
        *(look.label for look in LOOKS.values()),
    ]:
        assert text in said


def test_a_missing_cell_and_a_diverged_seed_are_in_the_panel_and_in_the_legend() -> None:
    cells = {"Hopper-v5": {"beta": curve(1, diverged=2), "logit-normal": None, "gaussian": curve(0)}}
    fig = study_figures.learning_curves(cells)
    panel = fig.axes[0].texts[0].get_text()
    assert panel.splitlines() == ["Beta: n = 8, 2 left out", "Logit-normal: missing"]
    assert len(fig.axes[0].lines) == 2
    said = words(fig)
    assert "n = 10 seeds unless noted" in said
    assert said.count("Logit-normal") == 2


def test_seeds_that_count_although_they_diverged_are_named() -> None:
    marked = dataclasses.replace(curve(0).estimate, diverged=3)
    fig = study_figures.learning_curves({"Hopper-v5": {"beta": Curve(STEPS, marked), "gaussian": curve(0)}})
    assert fig.axes[0].texts[0].get_text() == "Beta: n = 10, 3 diverged"
    one = dataclasses.replace(estimate(scores(0)), diverged=1)
    assert [t.get_text() for t in study_figures.interval_panels({"a": {"beta": one}}).axes[0].texts] == [
        "n = 10, 1 diverged"
    ]


def test_interval_panels_show_value_and_interval_in_the_familys_look() -> None:
    cells = {robot: {f: estimate(scores(i)) for i, f in enumerate(LOOKS)} for robot in ROBOTS[:3]}
    fig = study_figures.interval_panels(cells, xlabel="return")
    assert len(fig.axes) == 3
    for ax in fig.axes:
        bars, markers = ax.lines[::2], ax.lines[1::2]
        for i, family in enumerate(LOOKS):
            given = cells[ROBOTS[0]][family]
            assert bars[i].get_xdata().tolist() == [given.low, given.high]
            assert markers[i].get_xdata().tolist() == [given.value]
            assert markers[i].get_marker() == LOOKS[family].marker
            assert to_hex(markers[i].get_markerfacecolor()) == LOOKS[family].color.lower()
            assert markers[i].get_ydata()[0] == i
            assert bars[i].get_linestyle() == "-", "a broken bar reads as another interval"
    assert "Marker: IQM. Bar: 95 % bootstrap interval. n = 10 seeds." in words(fig)
    assert "unless" not in words(fig)


def test_a_figure_of_few_seeds_says_that_its_intervals_fall_short() -> None:
    fig = study_figures.interval_panels({"Ant-v5": {"beta": estimate(scores(0)[:4])}})
    assert "95 % bootstrap interval (so few seeds cover 87.5 % at most). n = 4 seeds." in words(fig)


def test_a_panel_without_any_cell_has_no_scale() -> None:
    bars = study_figures.interval_panels(
        {"Ant-v5": {"beta": estimate(scores(0))}, "Hopper-v5": {"beta": None}}
    )
    lines = study_figures.learning_curves({"Ant-v5": {"beta": curve(0)}, "Hopper-v5": {"beta": None}})
    for fig in (bars, lines):
        fig.canvas.draw()
        drawn, empty = ([t.get_text() for t in ax.get_xticklabels() if t.get_visible()] for ax in fig.axes)
        assert any(drawn)
        assert not any(empty)


def test_a_row_keeps_its_place_where_its_cell_is_missing_and_is_hollow_where_a_seed_is() -> None:
    lost = np.where(np.arange(10) == 3, np.nan, scores(0))
    cells = {
        "Hopper-v5": {"gaussian": estimate(lost, missing="exclude"), "beta": None},
        "Ant-v5": {"beta": estimate(scores(1))},  # and no Gaussian was planned
    }
    hopper, ant = study_figures.interval_panels(cells).axes
    assert [t.get_text() for t in hopper.texts] == ["n = 9, 1 left out", "missing"]
    assert hopper.lines[1].get_markerfacecolor() == "white"
    assert [(t.get_text(), t.get_position()[1]) for t in ant.texts] == [("not planned", 0)]
    assert ant.lines[1].get_ydata()[0] == 1


def test_differences_stand_beside_zero_with_their_corrected_p_value() -> None:
    a, b = {r: scores(2, i) for i, r in enumerate(ROBOTS[:2])}, {ROBOTS[0]: scores(0)}
    rows = statistics.compare(a, b, np.random.default_rng(0))
    fig = study_figures.difference_panels({r: {("beta", "gaussian"): rows[r]} for r in rows})
    first, second = fig.axes
    assert first.lines[-1].get_xdata()[0] == 0.0
    assert first.texts[0].get_text() == "p < 0.001"
    assert second.texts[0].get_text() == "missing"
    assert first.get_yticklabels()[0].get_text() == "Beta\n− Gaussian"
    assert first.lines[1].get_markerfacecolor() == LOOKS["beta"].color
    assert "Filled: the interval leaves out 0, and the test finds the difference. Hollow: not." in words(fig)
    assert "difference of IQMs" in words(fig)
    assert "after Holm's correction" in words(fig)


def test_what_stands_beside_a_row_lies_outside_its_panel_and_what_is_not_found_is_hollow() -> None:
    gap = statistics.difference(scores(2), scores(0), np.random.default_rng(0))
    pairs = {
        ("beta", "gaussian"): statistics.Comparison(gap, 0.03, 0.18),
        ("logit-normal", "gaussian"): statistics.Comparison(None, np.nan, np.nan),
    }
    (ax,) = study_figures.difference_panels({"Ant": pairs}, noted=False).axes
    ax.figure.draw_without_rendering()
    assert [text.get_text() for text in ax.texts] == ["p = 0.180", "missing"]
    assert all(text.get_window_extent().x0 > ax.bbox.x1 for text in ax.texts)
    assert ax.lines[1].get_markerfacecolor() == "white"


def test_a_note_is_below_the_panels_or_in_a_caption() -> None:
    bars = {"Ant": {"beta": estimate(scores(0))}}
    note = " ".join(study_figures.interval_note(bars).split())
    assert note == "Marker: IQM. Bar: 95 % bootstrap interval. n = 10 seeds."
    for noted in (True, False):
        assert (note in words(study_figures.interval_panels(bars, noted=noted))) is noted
    lost = {"Ant": {"beta": estimate([np.nan, *scores(0)[1:]], missing="exclude")}}
    assert study_figures.interval_note(lost).endswith("Hollow: seeds are left out.")


@pytest.mark.parametrize("narrow", [False, True])
def test_profiles_are_drawn_as_given(narrow: bool) -> None:
    taus = np.linspace(0, 2, 21)
    rng = np.random.default_rng(0)
    profiles = {
        "beta": statistics.performance_profile({"a": rng.random(10), "b": 2 * rng.random(10)}, taus, rng),
        "gaussian": None,
    }
    fig = study_figures.performance_profiles(profiles, narrow=narrow)
    assert fig.get_size_inches()[0] == (NARROW if narrow else WIDTH)
    fig.draw_without_rendering()
    frame = fig.get_window_extent()
    for legend in fig.legends:
        box = legend.get_window_extent(fig.canvas.get_renderer())
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
    (line,) = fig.axes[0].lines
    assert np.array_equal(line.get_xydata(), np.stack([taus, profiles["beta"].share.value], -1))
    assert fig.axes[0].texts[0].get_text() == "Gaussian, clipped: missing"
    assert "at each τ by itself" in words(fig)


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("rows", [1, 2, 5, 6])
@pytest.mark.parametrize("kind", ["curves", "bars", "differences"])
def test_nothing_overlaps_or_leaves_the_figure(rows: int, kind: str, narrow: bool) -> None:
    robots = ROBOTS[:rows]
    if kind == "curves":
        fig = study_figures.learning_curves(
            {r: {f: curve(i) for i, f in enumerate(LOOKS)} for r in robots}, narrow=narrow
        )
    elif kind == "bars":
        lost = estimate([np.nan, *scores(0)[1:]], missing="exclude")
        fig = study_figures.interval_panels({r: dict.fromkeys(LOOKS, lost) for r in robots}, narrow=narrow)
    else:
        lost = statistics.difference(
            [np.nan, *scores(0)[1:]], scores(1), np.random.default_rng(0), missing="exclude"
        )
        row = statistics.Comparison(lost, 0.0001, 0.0006)
        pairs = [("logit-normal", "clipped-gaussian"), ("beta", "gaussian")]
        fig = study_figures.difference_panels({r: dict.fromkeys(pairs, row) for r in robots}, narrow=narrow)
    assert fig.get_size_inches()[0] == (NARROW if narrow else WIDTH)
    if narrow:
        assert all(ax.get_subplotspec().get_gridspec().ncols == 1 for ax in fig.axes)
    fig.draw_without_rendering()
    renderer = fig.canvas.get_renderer()
    boxes = [ax.get_tightbbox(renderer) for ax in fig.axes]
    boxes += [legend.get_window_extent(renderer) for legend in fig.legends]
    boxes += [t.get_window_extent(renderer) for t in fig.texts if t.get_text()]  # heading and common labels
    for i, box in enumerate(boxes):
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= fig.bbox.width
        assert box.y1 <= fig.bbox.height
        for other in boxes[:i]:
            assert mpl.transforms.Bbox.intersection(box.padded(-1), other.padded(-1)) is None


def test_an_empty_study_is_a_figure_of_missing_cells() -> None:
    fig = study_figures.learning_curves({r: dict.fromkeys(LOOKS) for r in ROBOTS})
    assert words(fig).count("missing") == len(ROBOTS) * len(LOOKS)
    assert "No cell is complete yet." in words(fig)
    assert png_bytes(fig).startswith(b"\x89PNG")


def test_what_cannot_be_drawn_is_refused() -> None:
    good = estimate(scores(0))
    mean = estimate(scores(0), statistic="mean")
    for bad, fix in [
        (lambda: study_figures.learning_curves({}), "nothing to draw"),
        (lambda: study_figures.interval_panels({"a": {}}), "nothing to draw"),
        (lambda: study_figures.difference_panels({}), "nothing to draw"),
        (lambda: study_figures.interval_panels({"a": {"cauchy": good}}), "choose one of gaussian"),
        (lambda: study_figures.performance_profiles({"cauchy": None}), "choose one of gaussian"),
        (
            lambda: study_figures.interval_panels({"a": {"beta": good, "gaussian": mean}}),
            "draw them apart",
        ),
        (lambda: study_figures.interval_panels({"a": {"beta": curve(0).estimate}}), "one number a row"),
        (
            lambda: study_figures.learning_curves({"a": {"beta": Curve(STEPS[1:], curve(0).estimate)}}),
            "one return an epoch",
        ),
    ]:
        with pytest.raises(ValueError, match=fix):
            bad()
