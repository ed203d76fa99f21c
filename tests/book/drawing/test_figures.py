"""The book's figures: every reader can tell the families apart, alt text reaches the page, panels show the numbers."""

import base64
import io
import itertools
import json
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image
from scipy import stats

from inbounds.book.drawing import alt_text, figures
from tests.book.colour_vision import GROUNDS, VISION, cie_lab, contrast, linear_rgb

PALETTES = {
    "white": ({family: look.color for family, look in figures.LOOKS.items()}, GROUNDS["white"]),
    "dark": ({family: look.color_on_dark for family, look in figures.LOOKS.items()}, GROUNDS["dark"]),
    "shades": (dict(enumerate(figures.SHADES)), GROUNDS["white"]),
}


@pytest.fixture(autouse=True)
def _headless() -> Any:
    plt.switch_backend("agg")
    yield
    plt.close("all")


@pytest.mark.parametrize("palette", PALETTES)
@pytest.mark.parametrize("vision", VISION)
def test_colours_differ_under_every_colour_vision(palette: str, vision: str) -> None:
    colors, _ = PALETTES[palette]
    seen = {name: cie_lab(VISION[vision] @ linear_rgb(color)) for name, color in colors.items()}
    for a, b in itertools.combinations(seen, 2):
        assert np.linalg.norm(seen[a] - seen[b]) > 15, (a, b)


@pytest.mark.parametrize("palette", PALETTES)
def test_colours_differ_in_greyscale_and_stand_out(palette: str) -> None:
    colors, background = PALETTES[palette]
    lightness = {name: cie_lab(linear_rgb(color))[0] for name, color in colors.items()}
    for a, b in itertools.combinations(lightness, 2):
        assert abs(lightness[a] - lightness[b]) > 7, (a, b)
    for name, color in colors.items():
        assert contrast(color, background) > 2.95, name


@pytest.mark.parametrize("vision", VISION)
def test_no_other_curve_looks_like_a_family(vision: str) -> None:
    """Shades may be as light as a family is, so their colours must differ the more."""
    for shade, look in itertools.product(figures.SHADES, figures.LOOKS.values()):
        seen = [cie_lab(VISION[vision] @ linear_rgb(color)) for color in (shade, look.color)]
        assert np.linalg.norm(seen[0] - seen[1]) > 20, (shade, look.label)


def test_families_differ_in_line_and_marker_too() -> None:
    looks = figures.LOOKS.values()
    assert (
        len({look.linestyle for look in looks})
        == len({look.marker for look in looks})
        == len(figures.LOOKS)
        == 4
    )


def test_unknown_family_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="clipped-gaussian"):
        figures.family_style("normal")


def test_style_is_given_back() -> None:
    mpl.rcParams["font.size"] = 7.0
    with figures.use_style():
        assert mpl.rcParams["font.size"] == figures.STYLE["font.size"]
    assert mpl.rcParams["font.size"] == 7.0
    mpl.rcdefaults()


def shown(monkeypatch: pytest.MonkeyPatch, alt: str) -> tuple[dict[str, str], dict[str, Any]]:
    """What `show` hands to the notebook."""
    caught: list[tuple[Any, Any]] = []
    monkeypatch.setattr(
        "IPython.display.display", lambda data, metadata, raw: caught.append((data, metadata))
    )
    fig, ax = plt.subplots(figsize=(3, 2))
    ax.plot([0, 1], [1, 0])
    figures.show(fig, alt)
    assert not plt.fignum_exists(fig.number), "the inline backend would draw it again"
    return caught[0]


def test_show_hands_over_image_and_alt_text(monkeypatch: pytest.MonkeyPatch) -> None:
    data, metadata = shown(monkeypatch, "A line that\n   falls from one to zero.")
    assert data["text/plain"] == "Figure: A line that falls from one to zero."
    assert metadata["image/png"] == {"alt": "A line that falls from one to zero.", "width": 300}
    image = Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
    assert image.size == (600, 400)
    assert image.getpixel((0, 0)) == (255, 255, 255, 255)


def test_in_the_book_a_figure_is_a_drawing_unless_it_is_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    data, metadata = shown(monkeypatch, "A line that falls from one to zero.")
    expected = {"alt": "A line that falls from one to zero.", "width": 300, "narrow": ""}
    assert metadata == {"image/svg+xml": expected}
    drawing = ElementTree.fromstring(data["image/svg+xml"])
    assert drawing.get("viewBox") == "0 0 216 144"  # points, 72 an inch
    monkeypatch.setattr(alt_text, "LONGEST_DRAWING", len(data["image/svg+xml"]) - 1)
    data, metadata = shown(monkeypatch, "A line that falls from one to zero.")
    assert set(data) == {"image/png", "text/plain"}
    assert set(metadata) == {"image/png"}


@pytest.mark.parametrize("alt", ["", "  ", "a plot", "plot.png"])
def test_show_wants_a_sentence(alt: str) -> None:
    with pytest.raises(ValueError, match="say in a sentence"):
        figures.show(Figure(), alt)


@pytest.mark.parametrize("where", ["set_title", "set_xlabel", "set_ylabel"])
def test_a_label_that_is_cut_off_is_refused(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def figure(label: str) -> Figure:
        fig = Figure(figsize=(3, 2), layout="constrained")
        getattr(fig.subplots(), where)(label)
        return fig

    monkeypatch.setattr("IPython.display.display", lambda *_, **__: None)
    figures.show(figure("a label as long as this is wider than three inches"), "A figure of somebody's own.")
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    figures.show(figure("short"), "A figure whose label fits.")
    with pytest.raises(ValueError, match=r"a label as long as this.*break its line"):
        figures.show(
            figure("a label as long as this is wider than three inches"), "A figure whose label does not."
        )


@pytest.mark.parametrize("building", ["0", "1"])
def test_alt_text_reaches_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Any, building: str) -> None:
    """MyST-NB's own renderer, with the plugin, writes the alt text and leaves other outputs alone."""
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", building)
    from docutils.core import publish_string
    from myst_nb.core import render
    from myst_nb.docutils_ import Parser

    data, metadata = shown(monkeypatch, 'A "line" that falls & rises.')
    outputs = [
        nbformat.v4.new_output("display_data", data=data, metadata=metadata),
        nbformat.v4.new_output("display_data", data={"text/plain": "a plain output"}),
    ]
    cell = nbformat.v4.new_code_cell("figure", outputs=outputs, execution_count=1)
    monkeypatch.setattr(render, "load_mime_renders", lambda: [alt_text.AltTextRenderer])
    html = publish_string(
        json.dumps(nbformat.v4.new_notebook(cells=[cell])),
        parser=Parser(),
        writer_name="html5",
        settings_overrides={
            "nb_execution_mode": "off",
            "nb_output_folder": str(tmp_path),
            "output_encoding": "unicode",
            "report_level": 5,
        },
    )
    assert 'alt="A &quot;line&quot; that falls &amp; rises."' in html
    (file,) = tmp_path.glob("*.svg" if building == "1" else "*.png")
    assert file.name in html
    assert "a plain output" in html


@pytest.mark.parametrize("write", [figures.png_bytes, figures.svg_bytes])
def test_files_do_not_vary(write: Callable[[Figure], bytes]) -> None:
    first, second = (write(figures.beta_densities()) for _ in range(2))
    assert first == second


def curves(fig: Figure) -> list[dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Per panel: label -> x, y."""
    return [{line.get_label(): line.get_data() for line in ax.lines} for ax in fig.axes]


def test_beta_panels_show_beta_densities() -> None:
    panels = curves(figures.beta_densities({"two": [(2.0, 5.0), (0.5, 0.5)], "one": [(1.0, 3.0)]}))
    assert [set(panel) for panel in panels] == [{"(2, 5)", "(0.5, 0.5)"}, {"(1, 3)"}]
    x, y = panels[0]["(2, 5)"]
    np.testing.assert_allclose(y, stats.beta.pdf(x, 2.0, 5.0), rtol=1e-10)
    x, y = panels[0]["(0.5, 0.5)"]
    np.testing.assert_allclose(y, stats.beta.pdf(x, 0.5, 0.5), rtol=1e-10)


def test_logit_normal_panels_show_logit_normal_densities() -> None:
    panels = curves(figures.logit_normal_densities(locs=(0.0, 1.0), scales=(1.0, 2.0)))
    x, y = panels[1]["σ = 2"]
    latent = np.log(x / (1 - x))
    np.testing.assert_allclose(y, stats.norm.pdf(latent, 1.0, 2.0) / (x * (1 - x)), rtol=1e-9)


def test_panels_live_on_other_intervals() -> None:
    law = torch.distributions.Uniform(torch.tensor(-2.0), torch.tensor(3.0))
    fig = figures.density_panels([("flat", [("U", law)])], low=-2.0, high=3.0)
    x, y = curves(fig)[0]["U"]
    np.testing.assert_allclose(y, 0.2, rtol=1e-6)
    assert x.min() > -2.0
    assert fig.axes[0].get_xlim() == (-2.0, 3.0)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 40), st.integers(0, 40), st.integers(1, 40))
def test_saturation_is_what_the_outer_bars_say(at_low: int, at_high: int, inside: int) -> None:
    action = np.concatenate([np.full(at_low, -2.0), np.full(at_high, 5.0), np.linspace(-1.9, 4.9, inside)])
    fig = figures.saturation_histogram({"beta": action[:, None]}, low=-2.0, high=5.0, bins=7)
    (ax,) = fig.axes
    low, high = sorted((bar for bar in ax.patches if hasattr(bar, "get_height")), key=lambda bar: bar.get_x())
    assert low.get_x() + low.get_width() <= -2.0
    assert high.get_x() >= 5.0
    np.testing.assert_allclose(
        [low.get_height(), high.get_height()], np.array([at_low, at_high]) / action.size
    )
    (steps, *_) = (patch for patch in ax.patches if not hasattr(patch, "get_height"))
    np.testing.assert_allclose(steps.get_data().values.sum(), inside / action.size)
    assert [text.get_text() for text in ax.texts] == [f"{n / action.size:.0%}" for n in (at_low, at_high)]
    plt.close(fig)


def test_saturation_panels_share_their_scale() -> None:
    rng = np.random.default_rng(0)
    z = rng.normal(size=2000)
    fig = figures.saturation_histogram(
        {"gaussian": np.clip(z, -1, 1), "beta": z * 0, "logit-normal": np.tanh(z / 2)}
    )
    visible = [ax for ax in fig.axes if ax.get_visible()]
    assert [ax.get_title() for ax in visible] == ["Gaussian, clipped", "Beta", "Logit-normal"]
    assert len({ax.get_ylim() for ax in visible}) == 1


@pytest.mark.parametrize("action", [[1.5], [np.nan], []])
def test_actions_that_were_not_executed_are_refused(action: list[float]) -> None:
    with pytest.raises(ValueError, match="clip them"):
        figures.saturation_histogram({"gaussian": np.array(action)})


def test_no_actions_at_all() -> None:
    with pytest.raises(ValueError, match="mapping"):
        figures.saturation_histogram({})
