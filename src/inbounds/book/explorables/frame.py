"""The frame every explorable stands in: HTML, scripts, ids, static figure, controls.

An explorable is three things: a model in JavaScript, a pure function from control values to curves, table cells and
a sentence (`<name>.js` beside this file); a Bokeh layout with the controls and the empty curves; and a static
figure for print, for readers without JavaScript, and for the moment before BokehJS is there. `Explorable`
joins them.

Where BokehJS comes from:

- While the book is built (`INBOUNDS_BOOK_BUILD=1`) the output holds no script. The page that contains
  `class="inbounds-explorable"` loads `javascript_files`, which the build copies into `_static`.
- In a live notebook every output carries the scripts, but the browser runs only the first: rerunning or deleting
  one cell never leaves the others dead.
"""

from __future__ import annotations

import functools
import html
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bokeh
import matplotlib.pyplot as plt
from bokeh.embed import json_item
from bokeh.layouts import column, row
from bokeh.models import (
    ColumnDataSource,
    CustomJS,
    CustomJSTickFormatter,
    GlyphRenderer,
    InlineStyleSheet,
    Range1d,
    Slider,
    Span,
)
from bokeh.plotting import figure
from matplotlib.figure import Figure

from inbounds.book.building import builds_the_book
from inbounds.book.drawing import figures
from inbounds.book.drawing.variables import color_variables
from inbounds.book.explorables.legend import Mark
from inbounds.book.templates import script_json

_HERE = Path(__file__).parent

# ink: text; line: axes; grid: grid lines; handle, focus: sliders; page: the background a handle is cut out of.
_COLORS = {
    "light": {
        "ink": "#22272d", "line": "#5f6770", "grid": "#dfe3e8",
        "handle": "#0e2f66", "focus": "#cc7e14", "page": "#ffffff",
    },
    "dark": {
        "ink": "#ced6dd", "line": "#9ca4af", "grid": "#364150",
        "handle": "#6e9cfd", "focus": "#ffd394", "page": "#14181e",
    },
}  # fmt: skip

DASHES: dict[str, list[int]] = {"-": [], "--": [9, 4], "-.": [9, 4, 2, 4], ":": [2, 4]}
"""Matplotlib's line styles as BokehJS draws them [pixels on, off, …]."""


def javascript_files() -> list[Path]:
    """Return the scripts an explorable needs, in the order in which a page must load them.

    The first two are BokehJS as the installed Bokeh ships it; the rest are this package's own.

    Example:
        >>> [path.name for path in javascript_files()][:3]
        ['bokeh.min.js', 'bokeh-widgets.min.js', 'numerics.js']
    """
    bokeh_js = Path(bokeh.__file__).parent / "server" / "static" / "js"
    models = sorted(path for path in _HERE.glob("*.js") if path.name not in ("numerics.js", "shell.js"))
    return [
        bokeh_js / "bokeh.min.js",
        bokeh_js / "bokeh-widgets.min.js",
        _HERE / "numerics.js",
        *models,
        _HERE / "shell.js",
    ]


@dataclass(frozen=True)
class Explorable:
    """A figure with controls that runs in the reader's browser.

    Displays itself in a notebook and in the built book. Its plain text is fixed, and so is its HTML (ids included),
    so that two builds of the book are the same.

    Made by `bounded_densities`, which has an example.
    """

    name: str
    """Name of the JavaScript model, also the prefix of the ids: unique on a page."""
    title: str
    """What the reader can explore, in a few words."""
    alt: str
    """Alt text: what the figure shows, at the initial values too."""
    controls: tuple[Slider, ...]
    """Sliders; each is named like the argument of the model it sets."""
    plots: tuple[figure, ...]
    """Bokeh figures; their data sources and ranges are named like the model's results."""
    columns: Mapping[str, str]
    """Columns of the table: a key of `looks` (which gives colour and line style) and heading."""
    rows: Mapping[str, str]
    """Rows of the table: key in the model's `table`, and heading; a key of `looks` gets its line, too."""
    fallback: Callable[[], Figure]
    """Draws the static figure at the initial values."""
    looks: Mapping[str, figures.FamilyStyle] = field(default_factory=lambda: figures.LOOKS)
    """The look of every curve: the policy families', where the curves are families."""
    legend: tuple[Mark, ...] = ()
    """What the marks mean that no head of the table names, in the order of the plots."""

    def __post_init__(self) -> None:
        """Check the name, and make every control recompute the page."""
        if not (_HERE / f"{self.name.replace('-', '_')}.js").is_file():
            raise ValueError(
                f"no JavaScript model for {self.name!r}: add {self.name.replace('-', '_')}.js to {_HERE}"
            )
        for mark in self.legend:
            if mark.color not in self.looks and mark.color not in _COLORS["light"]:
                raise ValueError(
                    f"no colour {mark.color!r} for the mark of {mark.text!r}: add it to the looks"
                )
        refresh = CustomJS(code="inbounds.refresh(cb_obj.document)")
        for control in self.controls:
            control.js_on_change("value", refresh)

    def __repr__(self) -> str:
        """Return a line that never changes: what a notebook without a browser keeps of it."""
        return f"Explorable: {self.title}. {self.alt}"

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """HTML for browsers, one line of text for everything else."""
        live = not builds_the_book()
        return {"text/html": self.html(live=live), "text/plain": repr(self)}

    @functools.cached_property
    def _static_image(self) -> str:
        """The static figure as a data URI."""
        fig = self.fallback()
        address = figures.svg_uri(fig)
        plt.close(fig)
        return address

    @functools.cached_property
    def _item(self) -> str:
        """The Bokeh document as JSON, with ids that do not depend on what was drawn before, and nothing twice."""
        for control in self.controls:
            control.stylesheets = self.controls[0].stylesheets
        for renderer in (
            each for fig in self.plots for each in fig.renderers if isinstance(each, GlyphRenderer)
        ):
            renderer.update(muted_glyph=None, nonselection_glyph=None)  # nothing is muted or selected here
        controls = row(
            *self.controls, sizing_mode="stretch_width", styles={"flex-wrap": "wrap", "gap": "0 1rem"}
        )
        layout = column(controls, *self.plots, sizing_mode="stretch_width")
        return script_json(_with_fixed_ids(json_item(layout), self.name))

    def html(self, *, live: bool) -> str:
        """Return the explorable as HTML.

        Args:
            live: Carry the scripts along, for a notebook; False leaves them to the page (see the module's text).
        """
        alt = html.escape(self.alt)
        return (
            f'<div class="inbounds-explorable" data-model="{self.name}" data-alt="{alt}" role="group" '
            f'aria-label="{html.escape(self.title)}" style="{self._room}">'
            f"<style>{_style_sheet(tuple(self.looks.items()))}</style>"
            f'<div class="inbounds-static"><img src="{self._static_image}" alt="{alt}">{self._legend()}</div>'
            f'<div class="inbounds-live"><div class="inbounds-plot"></div>{self._legend()}{self._table()}'
            f'<p class="inbounds-note" aria-live="polite"></p></div>'
            f'<script type="application/json">{self._item}</script>'
            f"{_scripts() if live else ''}</div>"
        )

    @property
    def _room(self) -> str:
        """What a page needs to keep the explorable's place before it runs: height of plots, number of controls."""
        heights = sum(plot.height or 0 for plot in self.plots)
        return f"--inbounds-plots: {heights}px; --inbounds-controls: {len(self.controls)}"

    def _legend(self) -> str:
        """Return the marks and what they mean, a list; nothing where the table's heads say it all."""
        items = "".join(f"<li>{mark.swatch()}<span>{mark.text}</span></li>" for mark in self.legend)
        return f'<ul class="inbounds-legend">{items}</ul>' if items else ""

    def _table(self) -> str:
        """Return the table of read-outs; its header is the legend of the plot."""
        heads = "".join(
            f'<th scope="col">{_swatch(key, self.looks[key])}{text}</th>'
            for key, text in self.columns.items()
        )
        cells = "<td></td>" * len(self.columns)
        body = "".join(
            f'<tr data-row="{key}"><th scope="row">{_swatch(key, self.looks[key]) if key in self.looks else ""}'
            f"{text}</th>{cells}</tr>"
            for key, text in self.rows.items()
        )
        table = f"<table><thead><tr><td></td>{heads}</tr></thead><tbody>{body}</tbody></table>"
        return f'<div class="inbounds-scroll">{table}</div>'


def _with_fixed_ids(item: Any, name: str) -> Any:
    """Rename Bokeh's ids, which count every model of the process, in the order in which they appear."""
    fixed: dict[str, str] = {}

    def collect(node: Any) -> None:
        if isinstance(node, dict):
            if isinstance(node.get("id"), str):
                fixed.setdefault(node["id"], f"{name}-{len(fixed)}")
            for value in node.values():
                collect(value)
        elif isinstance(node, (list, tuple)):
            for value in node:
                collect(value)

    def rename(node: Any) -> Any:
        if isinstance(node, dict):
            return {
                key: fixed[value] if key in ("id", "root_id") and value in fixed else rename(value)
                for key, value in node.items()
            }
        return [rename(value) for value in node] if isinstance(node, (list, tuple)) else node

    collect(item["doc"])
    return rename(item)


@functools.cache
def _style_sheet(looks: tuple[tuple[str, figures.FamilyStyle], ...]) -> str:
    """Return the style of an explorable, with the colours of its curves for both themes."""
    itself, dark = (
        ":is(.inbounds-explorable, .inbounds-static)",
        '{}[data-theme="dark"]',
    )  # a still picture stays light
    variables = color_variables(itself, "inbounds", _COLORS, dict(looks), dark)
    return "\n".join([variables, (_HERE / "explorables.css").read_text(encoding="utf-8")])


@functools.cache
def _scripts() -> str:
    """Return all scripts in one element that runs each at most once per page."""
    texts = [path.read_text(encoding="utf-8") for path in javascript_files()]
    load = (
        "((sources) => {"
        f"if (!globalThis.inbounds?.boot || !globalThis.Bokeh?.['{bokeh.__version__}'])"
        " for (const text of sources)"
        " document.head.appendChild(Object.assign(document.createElement('script'), {textContent: text}));"
        " else inbounds.boot();"
        f"}})({script_json(texts)})"
    )
    return f"<script>{load}</script>"


def _swatch(name: str, look: figures.FamilyStyle) -> str:
    """Return a short line in a curve's colour and dash."""
    dashes = " ".join(map(str, DASHES[look.linestyle]))
    return (
        '<svg width="44" height="6" aria-hidden="true"><line x1="0" y1="3" x2="44" y2="3" stroke-width="3" '
        f'stroke="var(--inbounds-{name})" stroke-dasharray="{dashes}"/></svg>'
    )


def slider(
    name: str,
    title: str,
    start: float,
    end: float,
    value: float,
    step: float,
    *,
    log: bool = False,
    digits: int = 2,
) -> Slider:
    """Return a slider that sets one argument of the model.

    Args:
        name: The model's argument.
        title: What the reader sees and a screen reader says.
        start: Lower end.
        end: Upper end.
        value: Initial value.
        step: Step of an arrow key.
        log: The argument is a natural logarithm; show its exponential.
        digits: Decimals that are shown.
    """
    shown = "Math.exp(tick)" if log else "tick"
    code = f"return ({shown}).toFixed({digits}).replace('-', '−')"
    return Slider(
        name=name, title=title, start=start, end=end, value=value, step=step, tooltips=False,
        format=CustomJSTickFormatter(code=code), sizing_mode="stretch_width",
        stylesheets=[InlineStyleSheet(css=(_HERE / "slider.css").read_text(encoding="utf-8"))],
    )  # fmt: skip


def plot(
    x_label: str, y_label: str, x_range: tuple[float, float], y_name: str, *, height: int = 320
) -> figure:
    """Return an empty Bokeh figure as wide as the page, without tools, whose y range the model sets under `y_name`."""
    fig = figure(
        height=height, sizing_mode="stretch_width", toolbar_location=None, tools="",
        x_range=Range1d(*x_range), y_range=Range1d(0, 1, name=y_name), x_axis_label=x_label, y_axis_label=y_label,
        background_fill_color=None, border_fill_color=None, outline_line_color=None, min_border_right=8,
    )  # fmt: skip
    fig.axis.axis_label_text_font_style = "normal"
    fig.axis.axis_label_text_font_size = "14px"
    fig.axis.major_label_text_font_size = "13px"
    return fig


def bounds(fig: figure) -> None:
    """Draw a thin upright line at each bound of the box [-1, 1]; `BOUNDS` is its mark."""
    fig.renderers.extend(
        Span(location=bound, dimension="height", line_width=1, name="bounds") for bound in (-1.0, 1.0)
    )


BOUNDS = Mark("upright", "line", "bounds of the box", of=("bounds",))


def family_curve(fig: figure, family: str) -> None:
    """Add a policy family's curve, empty; the model fills the source of the same name with `x` and `y`."""
    curve(fig, family, figures.LOOKS[family], source=family)


def curve(fig: figure, name: str, look: figures.FamilyStyle, *, source: str) -> None:
    """Add an empty curve.

    Args:
        fig: The figure.
        name: The curve's key in the explorable's `looks`, by which the page colours it.
        look: Its look.
        source: The key under which the model gives its `x` and `y`; unique in the explorable.
    """
    data = ColumnDataSource({"x": [], "y": []}, name=source)
    fig.line("x", "y", source=data, name=name, line_width=3, line_dash=DASHES[look.linestyle])
