"""The clipped surrogate: the explorable's JavaScript, the package, and autograd agree."""

import itertools
import json

import numpy as np
import pytest

from inbounds.book.explorables.ppo_clip import CURVES, ppo_clip, surrogate_and_slope
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["ppo-clip"]'
CALL = f"points.map(([ratio, advantage, clip_range]) => {MODEL}({{ ratio, advantage, clip_range }}))"
RNG = np.random.default_rng(10)
# The six cases at two ε, and points in between; no corner, where a derivative is a matter of taste.
POINTS = [
    *itertools.product((0.05, 0.9, 1.1, 2.45), (-2.0, -0.3, 0.7), (0.16, 0.5)),
    *RNG.uniform([0.01, -2.0, 0.02], [2.5, 2.0, 0.5], (12, 3)).tolist(),
]


@pytest.fixture(scope="module")
def states() -> list[dict]:
    return run_js(CALL, points=POINTS)


def test_javascript_agrees_with_the_package_and_autograd(states: list[dict]) -> None:
    for (ratio, advantage, clip_range), state in zip(POINTS, states, strict=True):
        value, slope = surrogate_and_slope(ratio, advantage, clip_range)
        assert state["here"]["value"] == pytest.approx(float(value), abs=1e-12)
        assert state["here"]["slope"] == pytest.approx(float(slope), abs=1e-12)
        x = np.array(state["sources"]["smaller"]["x"])
        kept = x > 0
        expected = surrogate_and_slope(x[kept], advantage, clip_range)[0]
        np.testing.assert_allclose(np.array(state["sources"]["smaller"]["y"])[kept], expected, atol=1e-12)
        low, high = state["ranges"]["y"]
        for name in CURVES:
            y = np.array(state["sources"][name]["y"])
            assert low <= y.min()
            assert y.max() <= high
        shown = float(state["table"]["value"][2].replace("−", "-"))
        assert shown == pytest.approx(float(value), abs=6e-3)


def test_slopes_of_the_candidates_are_theirs(states: list[dict]) -> None:
    h = 1e-6
    for (ratio, advantage, clip_range), state in zip(POINTS, states, strict=True):
        clipped = (
            np.diff(np.clip([ratio - h, ratio + h], 1 - clip_range, 1 + clip_range)) * advantage / (2 * h)
        )
        shown = [float(cell.replace("−", "-")) for cell in state["table"]["slope"]]
        assert shown[0] == pytest.approx(advantage, abs=6e-3)
        assert shown[1] == pytest.approx(float(clipped[0]), abs=6e-3)


@pytest.mark.parametrize(
    ("ratio", "advantage", "words"),
    [
        (1.1, 1.0, "pushes it up"),
        (0.9, -1.0, "pushes it down"),
        (1.5, 1.0, "nothing pulls back"),
        (0.5, -1.0, "nothing pulls back"),
        (0.5, 1.0, "leads back"),
        (1.5, -1.0, "leads back"),
        (1.5, 0.0, "asks for nothing"),
        (1.2, 1.0, "stands at the end of the interval, in the direction that was wanted"),
        (0.8, 1.0, "stands at the end of the interval, in the wrong direction"),
        (1.25, 1.0, "has left the interval in the direction"),
    ],
)
def test_the_note_names_the_case(ratio: float, advantage: float, words: str) -> None:
    (state,) = run_js(CALL, points=[(ratio, advantage, 0.2)])
    assert words in state["note"]


def test_html_and_fallback() -> None:
    explorable = ppo_clip(ratio=0.6, advantage=-1.0)
    html = explorable.html(live=False)
    assert len(html) < 120_000
    assert "the surrogate is -0.80 and its slope 0.00" in explorable.alt
    for look in CURVES.values():
        assert look.color in html
        assert look.label in html
    (state,) = run_js(CALL, points=[(0.6, -1.0, 0.2)])
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    lines = {line.get_label(): line.get_data() for line in explorable.fallback().axes[0].lines}
    for name, look in CURVES.items():
        x, y = lines[look.label]
        source = state["sources"][name]
        np.testing.assert_allclose(np.interp(x, source["x"], source["y"]), y, atol=1e-9)


@pytest.mark.parametrize("bad", [{"ratio": -0.1}, {"ratio": 3.0}, {"advantage": 2.5}, {"clip_range": 0.0}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="choose"):
        ppo_clip(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(CURVES.values(), ground)
