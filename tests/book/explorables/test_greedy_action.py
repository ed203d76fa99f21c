"""Three greedy actions in the browser: the JavaScript agrees with the package and with SciPy."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from inbounds.book.drawing import figures
from inbounds.book.explorables.greedy_action import CENTRES, GreedyActions, greedy_actions
from tests.book.colour_vision import GROUNDS, VISION, assert_looks_differ, cie_lab, linear_rgb
from tests.book.explorables.test_bounded_densities import run_js

# Both sides of the bimodality condition, both signs, the sliders' ends.
POINTS = list(itertools.product((-4.0, -0.3, 0.1, 1.0, 4.0), (-3.0, 0.0, 0.3, 0.45, 1.0)))


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    model = 'inbounds.models["greedy-action"]'
    return run_js(f"points.map(([mu, log_sigma]) => {model}({{ mu, log_sigma }}))", points=POINTS)


def policy(point: tuple[float, float]) -> GreedyActions:
    return GreedyActions(point[0], float(np.exp(point[1])))


def test_actions_are_the_package_s(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        for name, action in policy(point).actions.items():
            assert state["centres"][name] == pytest.approx(action, abs=1e-9), (name, point)


def test_slopes_are_autograd_s(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        for name, slope in policy(point).slopes.items():
            assert state["slopes"][name] == pytest.approx(slope, rel=1e-6, abs=1e-9), (name, point)


def error(mu: float, sigma: float, centre: float, power: int) -> float:
    """E[|a - centre|^power] by adaptive quadrature, split where the integrand has its kink."""
    kink = float(np.clip((2 * np.arctanh(centre) - mu) / sigma, -9, 9))

    def integrand(t: float) -> float:
        return float(stats.norm.pdf(t) * abs(np.tanh((mu + sigma * t) / 2) - centre) ** power)

    ends = sorted({-9.0, min(kink, 0.0), max(kink, 0.0), 9.0})
    return float(sum(integrate.quad(integrand, a, b, limit=200)[0] for a, b in itertools.pairwise(ends)))


def test_errors_are_scipy_s_and_each_centre_wins_its_own(states: list[dict[str, Any]]) -> None:
    for (mu, log_sigma), state in zip(POINTS, states, strict=True):
        sigma, errors = float(np.exp(log_sigma)), state["errors"]
        for name, centre in state["centres"].items():
            assert errors[name]["absolute"] == pytest.approx(error(mu, sigma, centre, 1), abs=2e-5)
            assert errors[name]["rms"] == pytest.approx(np.sqrt(error(mu, sigma, centre, 2)), abs=1e-6)
        for kind, best in (("absolute", "median"), ("rms", "mean")):
            least = min(found[kind] for found in errors.values())
            assert errors[best][kind] == pytest.approx(least, abs=1e-6)


def test_curves_pass_through_the_sliders(states: list[dict[str, Any]]) -> None:
    for (mu, log_sigma), state in zip(POINTS, states, strict=True):
        for name, centre in state["centres"].items():
            for axis, at in (("mu", mu), ("sigma", log_sigma)):
                source = state["sources"][f"{axis}_{name}"]
                y = np.array(source["y"], dtype=float)  # the jump's gap is null
                seen = np.interp(at, source["x"], y)
                assert seen == pytest.approx(centre, abs=2e-2)
            assert state["sources"][f"at_{name}"]["x"] == [centre, centre]
        gaps = [value is None for value in state["sources"]["mu_mode"]["y"]]
        assert sum(gaps) == (np.exp(2 * log_sigma) > 2)


def test_the_cusp_has_no_slope() -> None:
    """At μ = 0, σ² = 2 the mode's slope is infinite, and the page says so."""
    state = run_js(f'inbounds.models["greedy-action"]({{ mu: 0, log_sigma: {np.log(2) / 2} }})')
    assert state["table"]["slope"][2] == "∞"


def test_table_and_note(states: list[dict[str, Any]]) -> None:
    explorable = greedy_actions()
    for point, state in zip(POINTS, states, strict=True):
        assert set(state["table"]) == set(explorable.rows)
        assert {len(cells) for cells in state["table"].values()} == {len(CENTRES)}
        assert ("two peaks" in state["note"]) == bool(policy(point).law.is_bimodal)
        assert float(state["table"]["action"][1].replace("−", "-")) == pytest.approx(
            np.tanh(point[0] / 2), abs=6e-4
        )


def test_static_figure() -> None:
    explorable = greedy_actions(mu=0.1, sigma=2.0)
    assert "mean 0.030, median 0.050, mode 0.962" in explorable.alt
    fig = explorable.fallback()
    assert [text.get_text() for text in fig.legends[0].get_texts()] == list(CENTRES)
    mode = fig.axes[1].lines[2].get_ydata()
    assert np.isnan(mode).any()  # the jump is left open
    assert np.nanmax(np.abs(np.diff(mode))) < 0.1
    assert explorable.controls[0].value == 0.1


@pytest.mark.parametrize(("mu", "sigma"), [(5.0, 1.0), (0.0, 3.0), (0.0, 0.0)])
def test_values_outside_the_sliders_are_refused(mu: float, sigma: float) -> None:
    with pytest.raises(ValueError, match="choose mu in"):
        greedy_actions(mu, sigma)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_and_none_is_a_family_s(ground: str) -> None:
    """With every kind of colour vision: the logit-normal's density lies in the same picture."""
    assert_looks_differ(CENTRES.values(), ground, lightness_gap=7)
    key = "color" if ground == "white" else "color_on_dark"
    for centre, family in itertools.product(CENTRES.values(), figures.LOOKS.values()):
        mine, other = (linear_rgb(getattr(look, key)) for look in (centre, family))
        for vision in VISION.values():
            gap = np.linalg.norm(cie_lab(vision @ mine) - cie_lab(vision @ other))
            assert gap > 20, (centre.label, family.label)
