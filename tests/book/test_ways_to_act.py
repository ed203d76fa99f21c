"""Chapter 6's figure of the study's policies: a row per cell, named in words, nothing cut off or covered."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from inbounds.book.drawing import figures
from inbounds.book.report import bang_bang, study_pages, ways_to_act
from inbounds.book.report.ways_to_act import Row
from inbounds.study.grid import all_cells
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import Estimate
from inbounds.study.ways_played import evaluated


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return study_pages.shipped()


@pytest.fixture(scope="module")
def kept(outcomes: Outcomes) -> list[Outcome]:
    return [o for o in outcomes.finished.values() if o.ways and o.cell.family in ("beta", "logit-normal")]


@pytest.fixture(scope="module")
def rows(outcomes: Outcomes) -> list[Row]:
    return ways_to_act.rows_of(outcomes)


@pytest.fixture(scope="module")
def figure(rows: list[Row]) -> Figure:
    with figures.use_style():
        fig = ways_to_act.draw(rows)
        fig.draw_without_rendering()
    return fig


def boxes(fig: Figure, texts: list[Text]) -> list[tuple[str, Bbox]]:
    return [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]


def test_one_row_for_each_cell(rows: list[Row], kept: list[Outcome]) -> None:
    names = [(row.robot, row.label) for row in rows]
    assert len(set(names)) == len(names) == len(kept) > 20


def test_rows_are_named_in_words(rows: list[Row], kept: list[Outcome]) -> None:
    variants = {o.cell.variant for o in kept} - {""}
    assert variants
    for row in rows:
        assert not any(raw in row.label for raw in variants), row.label
        assert row.label.split(",")[0] in {"PPO", "TRPO"}


def test_the_numbers_are_those_of_the_episodes(rows: list[Row], kept: list[Outcome]) -> None:
    """Of every cell, by hand: the difference of mean returns, in percent of the median's."""
    for way in ("mean", "mode", "sample"):
        by_hand = {
            (o.cell.robot, ways_to_act.in_words(o.cell)): 100
            * np.nanmean(o.ways[way] - o.ways["median"])
            / np.nanmean(np.abs(o.ways["median"]))
            for o in kept
        }
        for row in rows:
            assert row.gains[way].value == pytest.approx(by_hand[row.robot, row.label], rel=1e-9, abs=1e-9)
            assert row.gains[way].low <= row.gains[way].value <= row.gains[way].high


@pytest.mark.parametrize(("low", "high", "found"), [(-2, -1, -1), (-1, 1, 0), (1, 2, 1)])
def test_found_where_the_interval_leaves_zero_out(low: float, high: float, found: int) -> None:
    gain = Estimate((low + high) / 2, low, high, 10, 0, 0.95, "difference of means")
    assert Row("Ant", "PPO, Beta", "beta", {"mode": gain}).found("mode") == found


def test_no_text_is_cut_off_or_covers_another(figure: Figure) -> None:
    titles = [ax.title for ax in figure.axes]
    labels = figure.axes[0].get_yticklabels()
    assert all(title.get_text() for title in titles)
    for group in (boxes(figure, titles), boxes(figure, labels)):
        for name, box in group:
            assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1, name
            assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1, name
        for (first, a), (second, b) in combinations(group, 2):
            assert not a.overlaps(b), (first, second)


def test_each_panel_has_each_row(figure: Figure, rows: list[Row]) -> None:
    assert len(figure.axes) == len(ways_to_act.WAYS)
    for ax in figure.axes:
        assert len(ax.containers) == len(rows)


def test_what_three_seeds_did_at_the_bounds_is_no_row(outcomes: Outcomes) -> None:
    played = evaluated(outcomes.folder, all_cells())
    rows = bang_bang.rows_of(outcomes.folder)
    assert len(rows) == sum(len(cell.kept_seeds) == 10 for cell in played) > 50
    assert not any("Humanoid" in row.robot and "equal" in row.label for row in rows)
    assert any("equal" in row.label for row in rows)
    assert len({(row.robot, row.label) for row in rows}) == len(rows)
