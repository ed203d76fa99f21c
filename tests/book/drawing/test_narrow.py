"""A figure for a phone: one panel below the other, with every label, or none at all."""

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from inbounds.book.drawing import alt_text, figures
from inbounds.book.drawing.narrow import WIDTH, rearrange


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    with figures.use_style():
        yield
    plt.close("all")


def places(fig: Figure) -> list[tuple[int, int]]:
    return [(ax.get_subplotspec().rowspan.start, ax.get_subplotspec().colspan.start) for ax in fig.axes]  # type: ignore[union-attr]


def row_of(count: int, **options: object) -> Figure:
    fig, axes = plt.subplots(1, count, figsize=(6.8, 3), squeeze=False, **options)  # type: ignore[arg-type]
    for number, ax in enumerate(axes[0]):
        ax.plot([0, 1], [number, 3])
        ax.set(xlabel="x", title=f"panel {number}")
    axes[0, 0].set_ylabel("what they share")
    return fig


def test_panels_in_a_row_stand_in_a_column_and_each_says_what_they_shared() -> None:
    fig = row_of(3, sharey=True)
    assert rearrange(fig)
    assert places(fig) == [(0, 0), (1, 0), (2, 0)]
    assert fig.get_size_inches().tolist() == [WIDTH, 9.0]
    for ax in fig.axes:
        assert ax.get_ylabel() == "what they share"
        assert any(label.get_text() for label in ax.get_yticklabels() if label.get_visible())
        assert ax.get_ylim() == fig.axes[0].get_ylim()


def test_many_panels_stand_in_two_columns() -> None:
    fig, axes = plt.subplots(2, 3, figsize=(6.8, 5), sharex=True)
    for ax in axes.flat:
        ax.plot([0, 1], [0, 1])
        ax.set(xticks=[0, 1], yticks=[0, 1])
    assert rearrange(fig)
    assert places(fig) == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]
    assert all(ax.xaxis.get_tick_params()["labelbottom"] for ax in fig.axes)


def test_a_twin_stays_with_its_panel() -> None:
    fig = row_of(2)
    fig.axes[1].twinx().plot([0, 1], [5, 9])
    assert rearrange(fig)
    assert places(fig) == [(0, 0), (1, 0), (1, 0)]


def test_long_titles_and_labels_are_broken() -> None:
    fig = row_of(1)
    fig.axes[0].set(title="a title of more words " * 3, xlabel="a label that is longer than the panel " * 2)
    fig.supxlabel("what is said below all of the panels, and takes its room")
    assert rearrange(fig)
    assert all("\n" in text.get_text() for text in (fig.axes[0].title, fig.axes[0].xaxis.label, *fig.texts))


def test_a_legend_is_as_wide_as_the_figure_allows() -> None:
    fig = row_of(2)
    names = ["the first of four names", "the second", "the third of them", "and the last"]
    lines = [fig.axes[0].plot([0], [0])[0] for _ in names]
    fig.legend(lines, names, loc="outside lower center", ncols=4)
    assert rearrange(fig)
    (legend,) = fig.legends
    box = legend.get_window_extent()
    assert box.width <= fig.bbox.width
    assert [text.get_text() for text in legend.get_texts()] == names
    assert box.y1 < min(ax.get_window_extent().y0 for ax in fig.axes)  # still below


def test_a_panel_without_a_title_takes_its_columns() -> None:
    fig, axes = plt.subplots(2, 2, figsize=(6.8, 5))
    for ax, title in zip(axes[0], ("PPO", "TRPO"), strict=True):
        ax.set_title(title)
    axes[1, 1].set_title("its own")
    assert rearrange(fig)
    assert [ax.get_title() for ax in fig.axes] == ["PPO", "TRPO", "PPO", "its own"]


def test_a_legend_keeps_dashes_and_markers_beside_error_bars() -> None:
    fig, ax = plt.subplots(figsize=(6.8, 3.8))
    for number, look in enumerate(("o--", "s:")):
        ax.errorbar([0, 1], [number, number], yerr=0.1, fmt=look, label=look)
    fig.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    assert rearrange(fig)
    drawn = fig.legends[0].findobj(Line2D)
    assert {"--", ":"} <= {line.get_linestyle() for line in drawn}  # type: ignore[attr-defined]
    assert {"o", "s"} <= {line.get_marker() for line in drawn}  # type: ignore[attr-defined]


def test_a_legend_on_its_curves_moves_above_the_only_panel() -> None:
    fig, ax = plt.subplots(figsize=(6.8, 3.8))
    for number in range(4):
        ax.plot(np.linspace(0, 1, 50), np.linspace(0, 1, 50) ** number, label=f"the power {number} of x")
    ax.legend(loc="center")
    assert rearrange(fig)
    assert ax.get_legend() is None
    assert fig.legends[0].get_window_extent().y0 > ax.get_window_extent().y1


def cramped_ticks() -> Figure:
    fig = row_of(1)
    fig.axes[0].set_xticks(range(30), [f"tick {number}" for number in range(30)])
    return fig


def crossing_notes() -> Figure:
    fig = row_of(1)
    for x in (0.4, 0.45):
        fig.axes[0].text(x, 1, "a note beside a point")
    return fig


def covered_panel() -> Figure:
    fig = row_of(2)
    for number in range(7):
        fig.axes[0].plot([0, 1], [number, 7 - number], label=f"one of the many lines, {number}")
    fig.axes[0].legend(loc="center")
    return fig


def spanning() -> Figure:
    fig = plt.figure(figsize=(6.8, 4))
    fig.add_subplot(2, 1, 1)
    fig.add_subplot(2, 2, 3)
    return fig


def free() -> Figure:
    fig = plt.figure(figsize=(6.8, 4))
    fig.add_axes((0.1, 0.1, 0.8, 0.8))
    return fig


def small() -> Figure:
    fig = row_of(1)
    fig.set_size_inches(3, 3)
    return fig


@pytest.mark.parametrize("draw", [cramped_ticks, crossing_notes, covered_panel, spanning, free, small])
def test_what_could_not_be_read_has_no_shape_for_a_phone(draw) -> None:
    fig = draw()
    assert not rearrange(fig)
    assert alt_text.last_narrow(draw()) == ""


def test_the_shape_for_a_phone_is_handed_over_as_an_address() -> None:
    fig = row_of(2)
    assert alt_text.last_narrow(fig).startswith("data:image/svg+xml,")
    assert not plt.fignum_exists(fig.number)
