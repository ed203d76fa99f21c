"""Whatever an explorable draws is named, by a head of its table or by its legend. Sliders have names."""

import dataclasses
import functools
import importlib
import re
from pathlib import Path

import pytest
from bokeh.models import GlyphRenderer, Line, Span

import inbounds.book.explorables as folder
from inbounds.book.explorables.frame import DASHES, Explorable
from inbounds.book.explorables.legend import Mark

NAMES = sorted(path.stem for path in Path(folder.__file__).parent.glob("*.js"))
NAMES = [name for name in NAMES if name not in ("numerics", "shell")]
FUNCTIONS = {"greedy_action": "greedy_actions"}


@functools.cache
def explorable(name: str) -> Explorable:
    module = importlib.import_module(f"{folder.__name__}.{name}")
    made = getattr(module, FUNCTIONS.get(name, name))()
    assert isinstance(made, Explorable)
    return made


def by_its_head(drawn: GlyphRenderer, of: Explorable) -> bool:
    """Whether a head of the table has the line's colour and dash."""
    if drawn.name not in {*of.columns, *of.rows} or not isinstance(drawn.glyph, Line):
        return False
    return drawn.glyph.line_dash == DASHES[of.looks[drawn.name].linestyle] and drawn.glyph.line_width >= 2


def drawn(of: Explorable) -> list[str]:
    """What is drawn and has no head, by name."""
    renderers = [each for plot in of.plots for each in plot.renderers]
    sources = [
        each.data_source.name
        for each in renderers
        if isinstance(each, GlyphRenderer) and not by_its_head(each, of)
    ]
    return sources + [each.name for each in renderers if isinstance(each, Span)]


@pytest.mark.parametrize("name", NAMES)
def test_all_that_is_drawn_is_named(name: str) -> None:
    one = explorable(name)
    named = {source for mark in one.legend for source in mark.of}
    assert set(drawn(one)) <= named
    everything = {
        each.data_source.name for p in one.plots for each in p.renderers if isinstance(each, GlyphRenderer)
    }
    assert named <= everything | set(drawn(one)), "the legend names what nothing draws"


@pytest.mark.parametrize("name", NAMES)
def test_the_legend_stands_below_the_live_and_the_still_picture(name: str) -> None:
    one = explorable(name)
    html = one.html(live=False)
    for mark in one.legend:
        assert html.count(f"<span>{mark.text}</span>") == 2
    assert html.count('class="inbounds-sign"') == 2 * len(one.legend)


@pytest.mark.parametrize("name", NAMES)
def test_sliders_and_axes_have_names(name: str) -> None:
    one = explorable(name)
    titles = [slider.title for slider in one.controls]
    assert all(re.search(r"[A-Za-zΑ-ω]", title) for title in titles)
    assert len(set(titles)) == len(titles)
    assert all(plot.yaxis.axis_label for plot in one.plots)
    assert one.plots[-1].xaxis.axis_label


def test_a_mark_without_a_colour_is_refused() -> None:
    mark = Mark("ring", "nobody's", "this policy", of=("here",))
    with pytest.raises(ValueError, match="nobody's"):
        dataclasses.replace(explorable("ppo_clip"), legend=(mark,))
