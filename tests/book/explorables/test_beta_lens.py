"""A Beta in its lens: the explorable's JavaScript, its Python, SciPy and the package agree, and the note is true."""

import itertools
import json
from typing import Any

import numpy as np
import pytest
import torch
from scipy import optimize, stats

from inbounds.book.explorables.beta_lens import BetaInItsLens, beta_lens
from inbounds.distributions import LogitNormal
from inbounds.learning import Limits
from tests.book.explorables.test_bounded_densities import run_js

CAP = Limits().concentration_max
END = float(np.log(CAP))
RNG = np.random.default_rng(4)
# Corners and edges of the sliders, and points in between: (log α, log β).
POINTS = [
    *itertools.product((0.0, 0.7, END), repeat=2),
    *RNG.uniform(0.0, END, (20, 2)).tolist(),
]
INNER = [point for point in POINTS if min(point) > 0.0 and max(point) < END]


def parameters(point: tuple[float, float]) -> tuple[float, float]:
    alpha, beta = np.minimum(np.exp(point), CAP)
    return float(alpha), float(beta)


def scipy_place(alpha: Any, beta: Any) -> tuple[Any, Any]:
    """Mean and standard deviation on [-1, 1], by SciPy."""
    mean, variance = stats.beta.stats(alpha, beta)
    return 2 * mean - 1, 2 * variance**0.5


def logit_normal(mu: float, sigma: float) -> LogitNormal:
    return LogitNormal(*torch.tensor([mu, sigma], dtype=torch.float64), low=-1.0, high=1.0)


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    model = 'inbounds.models["beta-lens"]'
    call = f"points.map(([log_alpha, log_beta]) => {model}({{ log_alpha, log_beta }}))"
    return run_js(call, points=POINTS)  # type: ignore[no-any-return]


def test_the_two_laws_have_one_mean_and_one_spread(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        found = state["found"]
        mean, std = scipy_place(*parameters(point))
        assert [found["mean"], found["std"]] == pytest.approx([float(mean), float(std)], abs=1e-12)
        law = logit_normal(found["mu"], found["sigma"])
        assert float(law.mean) == pytest.approx(mean, abs=1e-10)
        assert float(law.stddev) == pytest.approx(std, abs=1e-10)
        ours = BetaInItsLens(*parameters(point)).logit_normal
        assert [float(ours.loc), float(ours.scale)] == pytest.approx([found["mu"], found["sigma"]], abs=1e-7)


def test_curves_are_scipy_s_and_the_package_s(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        alpha, beta = parameters(point)
        x = np.array(state["sources"]["beta"]["x"])
        drawn = np.array(state["sources"]["beta"]["y"])
        np.testing.assert_allclose(drawn, stats.beta.pdf(x, alpha, beta, -1, 2), rtol=1e-9, atol=1e-12)
        inside = (x > -1) & (x < 1)
        law = logit_normal(state["found"]["mu"], state["found"]["sigma"])
        other = np.array(state["sources"]["logit-normal"]["y"])
        expected = law.log_prob(torch.from_numpy(x[inside])).exp()
        np.testing.assert_allclose(other[inside], expected, rtol=1e-8, atol=1e-12)
        low, high = state["ranges"]["density"]
        assert low == 0
        assert max(drawn.max(), other.max()) < high


def test_reach_is_what_the_square_allows(states: list[dict[str, Any]]) -> None:
    """Along all pairs with one mean, the spreads of those in the square, by brute force."""
    for point, state in zip(POINTS, states, strict=True):
        alpha, beta = parameters(point)
        times = np.geomspace(1e-2, 1e2, 400_001)
        inside = (np.minimum(alpha, beta) * times >= 1) & (np.maximum(alpha, beta) * times <= CAP)
        inside |= np.isclose(times, 1)  # on the edge itself
        stds = scipy_place(alpha * times[inside], beta * times[inside])[1]
        found = [state["found"]["narrowest"], state["found"]["widest"]]
        np.testing.assert_allclose(found, [stds.min(), stds.max()], rtol=1e-4)
        np.testing.assert_allclose(found, BetaInItsLens(alpha, beta).reach(), rtol=1e-12)


def test_the_arch_is_the_widest_logit_normal_policy(states: list[dict[str, Any]]) -> None:
    widest = float(np.exp(Limits().log_std_max))
    for state in states[::3]:
        mean, stds = state["found"]["mean"], []
        for sigma in (0.2, 0.8, 1.6, 2.4, widest):
            mu = optimize.brentq(lambda m, s=sigma, mean=mean: float(logit_normal(m, s).mean) - mean, -40, 40)
            stds.append(float(logit_normal(mu, sigma).stddev))
        assert (np.diff(stds) > 0).all()
        assert state["found"]["roof"] == pytest.approx(stds[-1], abs=1e-9)
        assert state["found"]["roof"] > state["found"]["widest"]
    arch = states[0]["sources"]["arch"]
    laws = [logit_normal(mu, widest) for mu in np.linspace(-24, 24, 121)]
    np.testing.assert_allclose(arch["x"], [float(law.mean) for law in laws], atol=1e-9)
    np.testing.assert_allclose(arch["y"], [float(law.stddev) for law in laws], atol=1e-9)


def test_the_lens_is_round_the_square(states: list[dict[str, Any]]) -> None:
    """Every point of its edge is as wide or as narrow as its mean allows, and both ends are closed."""
    lens = states[0]["sources"]["lens"]
    reach = np.array(run_js("x.map(inbounds.betaLens.betaReach)", x=lens["x"]))
    gap = np.abs(reach - np.array(lens["y"])[:, None]).min(axis=1)
    assert gap.max() < 1e-12
    assert max(lens["y"]) == pytest.approx(1 / 3**0.5)
    assert min(lens["y"]) == pytest.approx(2 * stats.beta(CAP, 1).std())


def test_paths_change_one_parameter(states: list[dict[str, Any]]) -> None:
    side = np.geomspace(1, CAP, 81)
    for point, state in zip(POINTS, states, strict=True):
        alpha, beta = parameters(point)
        for name, place in (("alpha", scipy_place(side, beta)), ("beta", scipy_place(alpha, side))):
            path = state["sources"][f"path-{name}"]
            np.testing.assert_allclose([path["x"], path["y"]], place, atol=1e-12)
            assert (np.diff(path["x"]) > 0).all() == (name == "alpha")  # no piece of it is upright
            assert (np.diff(path["x"]) < 0).all() == (name == "beta")
        path = state["sources"]["path-sigma"]
        law = logit_normal(state["found"]["mu"], 1.0)
        laws = LogitNormal(law.loc, torch.linspace(-4, 1, 41, dtype=torch.float64).exp(), -1.0, 1.0)
        np.testing.assert_allclose(path["x"], laws.mean, atol=1e-9)
        np.testing.assert_allclose(path["y"], laws.stddev, atol=1e-9)


@pytest.mark.parametrize("which", [0, 1])
def test_the_note_says_where_more_of_a_parameter_leads(states: list[dict[str, Any]], which: int) -> None:
    letter, way = "αβ"[which], ("up", "down")[which]
    widened = set()
    for point, state in zip(POINTS, states, strict=True):
        if point not in INNER:
            continue
        more = list(parameters(point))
        more[which] *= 1 + 1e-6
        mean, std = scipy_place(*more)
        wider = bool(std > state["found"]["std"])
        assert (mean > state["found"]["mean"]) == (way == "up")
        words = f"ore {letter} moves the mean {way} and makes the law {'wider' if wider else 'narrower'}"
        assert words in state["note"], point
        widened.add(wider)
    assert widened == {True, False}


@pytest.mark.parametrize(
    ("point", "words", "mode"),
    [
        ((0.0, 0.0), "the uniform law, the widest of all", "none: flat"),
        ((1.0, 0.0), "no Beta policy is wider", "1.000"),
        ((0.0, 1.0), "no Beta policy is wider", "−1.000"),
        ((END, 1.0), "α is at its cap, 80; less of it moves the mean down and makes the law wider", "0.957"),
        ((0.0, END), "β is at its cap, 80; less of it moves the mean up and makes the law wider", "−1.000"),
        ((0.0, END), "no other Beta policy has this mean", "−1.000"),
        ((1.0, END), "no Beta policy is narrower", "−0.957"),
    ],
)
def test_the_edges_are_named(point: tuple[float, float], words: str, mode: str) -> None:
    state = run_js(
        'inbounds.models["beta-lens"]({ log_alpha: point[0], log_beta: point[1] })', point=list(point)
    )
    assert words in state["note"]
    assert state["table"]["mode"][0] == mode


def test_table_html_and_fallback(states: list[dict[str, Any]]) -> None:
    explorable = beta_lens(alpha=3.0, beta=1.5)
    assert len(explorable.html(live=False)) < 120_000
    assert "the mean is 0.33 and the standard deviation 0.40, of 0.09 to 0.47 possible" in explorable.alt
    state = run_js('inbounds.models["beta-lens"]({ log_alpha: Math.log(3), log_beta: Math.log(1.5) })')
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    for control in beta_lens().controls:  # as a page starts: the arrow to the left moves something
        assert control.start < control.value
    above, below = explorable.fallback().axes
    lines = {line.get_label(): line.get_data() for line in above.lines}
    for family, label in (("beta", "Beta"), ("logit-normal", "Logit-normal")):
        x, y = lines[label]
        source = state["sources"][family]
        np.testing.assert_allclose(np.interp(x, source["x"], source["y"]), y, atol=2e-3)
    x, y = below.lines[-1].get_data()
    np.testing.assert_allclose([x, y], [state["sources"]["here"][axis] for axis in "xy"], atol=1e-12)
    for point, shown in zip(POINTS, states, strict=True):
        law = BetaInItsLens(*parameters(point))
        for row, value in (("mean", law.law.mean), ("std", law.law.stddev), ("widest", law.reach()[1])):
            assert float(shown["table"][row][0].replace("−", "-")) == pytest.approx(float(value), abs=6e-4)


@pytest.mark.parametrize("bad", [{"alpha": 0.9}, {"alpha": 81.0}, {"beta": 0.0}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="choose both in"):
        beta_lens(**bad)
