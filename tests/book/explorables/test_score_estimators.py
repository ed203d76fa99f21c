"""Three estimators of one gradient: the explorable's JavaScript, its Python, and the definition agree."""

import json

import numpy as np
import pytest
from scipy import integrate, stats

from inbounds.book.explorables.score_estimators import ESTIMATORS, OneStep, score_estimators
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

RNG = np.random.default_rng(5)
# Corners of the sliders, and points in between: (μ, log σ, best action, baseline).
STEPS = [
    *[(mu, s, 1.0, share) for mu in (-2.4, 0.0, 2.4) for s in (-2.3, 0.0, 1.0) for share in (0.0, 1.0)],
    *RNG.uniform([-2.4, -2.3, -1.5, 0.0], [2.4, 1.0, 1.5, 1.0], (12, 4)).tolist(),
]


def reward(a: float, peak: float) -> float:
    return 1 - (a - peak) ** 2


def value(mu: float, sigma: float, peak: float) -> float:
    """Mean reward, by SciPy's adaptive quadrature and tails."""
    start, stop = np.clip([mu - 12 * sigma, mu + 12 * sigma], -1, 1)
    law = stats.norm(mu, sigma)
    between = integrate.quad(lambda z: law.pdf(z) * reward(z, peak), start, stop, epsabs=1e-13, limit=200)[0]
    return float(between + law.cdf(-1) * reward(-1, peak) + law.sf(1) * reward(1, peak))


@pytest.mark.parametrize("step", STEPS[:6] + STEPS[-4:])
def test_two_estimators_have_the_true_gradient(step: tuple[float, float, float, float]) -> None:
    """Central differences of the mean reward, which knows nothing of scores."""
    mu, log_sigma, peak, share = step
    h = 1e-4
    truth = [
        (value(mu + h, np.exp(log_sigma), peak) - value(mu - h, np.exp(log_sigma), peak)) / (2 * h),
        (value(mu, np.exp(log_sigma + h), peak) - value(mu, np.exp(log_sigma - h), peak)) / (2 * h),
    ]
    found = OneStep(mu, float(np.exp(log_sigma)), peak, share).moments()
    for name in ("drawn", "capg"):
        np.testing.assert_allclose(found[name][0], truth, atol=1e-5)
    assert (found["capg"][1] <= found["drawn"][1] + 1e-9).all()


def test_the_clipped_score_has_the_bias_of_the_formula() -> None:
    """(F(low) ψ(−u) − F(high) ψ(v))/σ with ψ(x) = φ(x) − x Φ(−x), for the paid reward F at the bounds."""
    for mu, log_sigma, peak, share in STEPS:
        sigma = float(np.exp(log_sigma))
        found = OneStep(mu, sigma, peak, share).moments()
        left, right = (mu + 1) / sigma, (1 - mu) / sigma
        low, high = (reward(a, peak) - share * value(mu, sigma, peak) for a in (-1, 1))
        loss = [stats.norm.pdf(x) - x * stats.norm.sf(x) for x in (left, right)]
        bias = (low * loss[0] - high * loss[1]) / sigma
        assert found["clipped"][0][0] - found["drawn"][0][0] == pytest.approx(bias, rel=1e-6, abs=1e-9)


def test_javascript_agrees() -> None:
    model = 'inbounds.models["score-estimators"]'
    call = f"points.map(([mu, log_sigma, peak, share]) => {model}({{ mu, log_sigma, peak, share }}))"
    names = list(ESTIMATORS)
    for (mu, log_sigma, peak, share), state in zip(STEPS, run_js(call, points=STEPS), strict=True):
        ours = OneStep(mu, float(np.exp(log_sigma)), peak, share).moments()
        for index, parameter in enumerate(("loc", "log_scale")):
            scale = max(ours[name][1][index] for name in names)
            for name in names:
                js = state["here"][parameter][name]
                assert js["mean"] == pytest.approx(ours[name][0][index], rel=1e-6, abs=1e-7 * scale + 1e-9)
                assert js["std"] == pytest.approx(ours[name][1][index], rel=1e-6, abs=1e-4 * scale + 1e-7)
        for row, name in enumerate(names):
            x, y = state["sources"][f"mean-{name}"].values()
            here, largest = state["here"]["loc"][name]["mean"], np.abs(y).max()
            assert np.interp(mu, x, y) == pytest.approx(here, rel=0.02, abs=0.02 * largest)
            shown = float(state["table"]["mean_loc"][row].replace("−", "-"))
            assert shown == pytest.approx(ours[name][0][0], abs=6e-4)
        for key in ("mean", "std"):
            low, high = state["ranges"][key]
            curves = np.array([state["sources"][f"{key}-{name}"]["y"] for name in names])
            assert low < curves.min()
            assert curves.max() < high
            assert state["sources"][f"at-{key}"] == {"x": [mu, mu], "y": [low, high]}


def test_note_says_when_the_sign_is_wrong() -> None:
    model = 'inbounds.models["score-estimators"]'
    states = run_js(f"[0.3, 1.6].map((mu) => {model}({{ mu, log_sigma: -1, peak: 1, share: 0 }}))")
    for mu, state in zip((0.3, 1.6), states, strict=True):
        found = OneStep(mu, float(np.exp(-1))).moments()
        opposite = found["clipped"][0][0] * found["capg"][0][0] < 0
        assert opposite == (mu == 1.6)
        assert ("wrong way" in state["note"]) == opposite


def test_note_compares_no_variances_where_there_are_none() -> None:
    """Every draw is clipped to −1, and paid nothing there."""
    point = "{ mu: -2.4, log_sigma: Math.log(0.1), peak: 0, share: 0 }"
    state = run_js(f'inbounds.models["score-estimators"]({point})')
    assert set(state["table"]["std_loc"]) == {"0.000"}
    assert "NaN" not in state["note"]
    assert state["note"].endswith("No estimator varies in μ by as much as 0.0005.")


def test_note_finds_no_sign_in_what_is_zero_but_for_rounding() -> None:
    point = "{ mu: 2.4, log_sigma: -1.7, peak: 1, share: 1 }"
    state = run_js(f'inbounds.models["score-estimators"]({point})')
    found = [state["here"]["loc"][name]["mean"] for name in ("clipped", "capg")]
    assert found[0] * found[1] < 0
    assert state["table"]["mean_loc"][1:] == ["0.000", "0.000"]
    assert "wrong way" not in state["note"]


def test_table_html_and_fallback() -> None:
    explorable = score_estimators(mu=0.4, sigma=0.5, share=0.5)
    html = explorable.html(live=False)
    assert len(html) < 120_000
    assert "μ = 0.4, σ = 0.5" in explorable.alt
    for look in ESTIMATORS.values():
        assert look.color in html
        assert look.label in html
    state = run_js(
        'inbounds.models["score-estimators"]({ mu: 0.4, log_sigma: Math.log(0.5), peak: 1, share: 0.5 })'
    )
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    for control in score_estimators().controls:  # as a page starts: the arrow to the left moves something
        assert control.start < control.value
    fig = explorable.fallback()
    for ax, key in zip(fig.axes, ("mean", "std"), strict=True):
        for line, name in zip(ax.lines[1:], ESTIMATORS, strict=True):
            x, y = line.get_data()
            source = state["sources"][f"{key}-{name}"]
            np.testing.assert_allclose(np.interp(x, source["x"], source["y"]), y, atol=1e-3 * y.max())


@pytest.mark.parametrize("bad", [{"mu": 3.0}, {"sigma": 0.0}, {"sigma": 3.0}, {"peak": 2.0}, {"share": 1.5}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="choose mu in"):
        score_estimators(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(ESTIMATORS.values(), ground, lightness_gap=7)
