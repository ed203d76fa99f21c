"""Bias and variance over λ: the explorable's JavaScript, its Python, and the package's `gae` agree."""

import itertools
import json

import numpy as np
import pytest
import torch

from inbounds.book.explorables.bias_and_variance import FAULTS, Fork, bias_and_variance
from inbounds.learning import gae
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["bias-and-variance"]'
CALL = f"points.map(([lam, missed, offset, visits]) => {MODEL}({{ lam, missed, offset, visits }}))"
RNG = np.random.default_rng(9)
# Corners of the sliders, the initial values, and points in between: (λ, roads, fork, visits).
POINTS = [
    *itertools.product((0.0, 0.5, 1.0), (0.0, 1.0), (0.0, 1.0), (1, 20)),
    (0.5, 0.6, 0.3, 4),
    *[(*RNG.uniform(size=3).tolist(), int(RNG.integers(1, 21))) for _ in range(12)],
]
STEPS = 400  # 0.9^400 is 5e-19: nothing of the road is left out


@pytest.fixture(scope="module")
def states() -> list[dict]:
    return run_js(CALL, points=POINTS)


def estimate(reward: np.ndarray, right: np.ndarray, fork: Fork, lam: float) -> np.ndarray:
    """The package's Â at the fork `[S]`, from rewards `[S, T]` on roads `[S]` (1 right, −1 left)."""
    road = (1 - fork.missed) * right * fork.pay / (1 - fork.gamma)
    value = np.repeat(road[:, None], STEPS, 1)
    value[:, 0] = fork.offset * fork.advantage
    never = torch.zeros(value.shape, dtype=torch.bool)
    ahead = torch.from_numpy(np.repeat(road[:, None], STEPS, 1))
    found, _ = gae(
        torch.from_numpy(reward), torch.from_numpy(value), never, never, ahead, fork.gamma, float(lam)
    )
    return found[:, 0].numpy()


def mean_rewards(right: np.ndarray, fork: Fork) -> np.ndarray:
    """`[S, T]`: nothing at the fork, then what the road pays."""
    paid = np.arange(STEPS) > 0
    return right[:, None] * fork.pay * paid


@pytest.mark.parametrize("lam", [0.0, 0.3, 0.8, 0.95, 1.0])
@pytest.mark.parametrize("missed", [0.0, 0.4, 1.0])
def test_bias_and_variance_are_those_of_the_package(lam: float, missed: float) -> None:
    """Â is linear in the rewards: their means give its mean, and one reward at a time gives each one's weight."""
    fork, both = Fork(missed, offset=0.7, visits=3), np.array([1.0, -1.0])
    means = estimate(mean_rewards(both, fork), both, fork, lam)
    gradient = (both * means).mean() / 2  # probability 1/2: the score of its logit is ±1/2
    truth = fork.advantage / 2
    found = fork.faults(lam)
    assert (gradient / truth - 1) ** 2 == pytest.approx(float(found["bias"]), abs=1e-12)

    careless = Fork(1.0, 0.0)  # its values are zero: what is left is linear
    weight = estimate(np.eye(STEPS), np.ones(STEPS), careless, lam)
    scatter = (weight**2).sum() / 4 + (both * means / 2).var()
    assert scatter / truth**2 / fork.visits == pytest.approx(float(found["variance"]), rel=1e-12)


def test_simulated_visits_agree() -> None:
    """20,000 visits with noise, drawn turns and a wrong critic, within five standard errors."""
    rng, visits = np.random.default_rng(4), 20_000
    fork = Fork(missed=0.5, offset=0.6)
    right = rng.choice([-1.0, 1.0], visits)
    reward = mean_rewards(right, fork) + rng.normal(size=(visits, STEPS))
    for lam in (0.0, 0.9, 1.0):
        sample = right / 2 * estimate(reward, right, fork, lam) / (fork.advantage / 2)
        expected = fork.faults(lam)
        error = np.sqrt(expected["variance"] / visits)
        assert sample.mean() == pytest.approx(1 - np.sqrt(expected["bias"]), abs=5 * float(error))
        kurtosis = ((sample - sample.mean()) ** 4).mean() / sample.var() ** 2
        spread = 5 * np.sqrt((kurtosis - 1) / visits)
        assert sample.var() == pytest.approx(float(expected["variance"]), rel=spread)


def test_what_the_reader_is_to_see() -> None:
    grid = np.linspace(0, 1, 101)
    perfect, wrong = Fork(0.0).faults(grid), Fork(0.7).faults(grid)
    assert (perfect["bias"] == 0).all()
    assert perfect["variance"].argmin() == 0
    assert (np.diff(wrong["bias"]) < 0).all()
    assert wrong["bias"][-1] == 0
    assert (np.diff(wrong["variance"]) > 0).all()
    shifted = Fork(0.7, offset=0.5).faults(grid)
    np.testing.assert_array_equal(shifted["bias"], wrong["bias"])
    np.testing.assert_allclose(shifted["variance"] - wrong["variance"], 0.25)
    assert Fork(0.6, visits=1).best() < Fork(0.6, visits=4).best() < Fork(0.6, visits=20).best()
    assert Fork(0.3, visits=4).best() < Fork(0.6, visits=4).best()


def test_javascript_agrees(states: list[dict]) -> None:
    for (lam, missed, offset, visits), state in zip(POINTS, states, strict=True):
        fork = Fork(missed, offset, visits)
        here = fork.faults(lam)
        low, high = state["ranges"]["y"]
        for index, name in enumerate(FAULTS):
            assert state["faults"][name] == pytest.approx(float(here[name]), abs=1e-12)
            x, y = (np.array(state["sources"][name][axis]) for axis in "xy")
            np.testing.assert_allclose(y, fork.faults(x)[name], atol=1e-12)
            assert low < y.min()
            assert y.max() < high
            ring = state["sources"][f"{name}-here"]
            assert ring == {"x": [lam], "y": [pytest.approx(float(here[name]), abs=1e-12)]}
            for row, at in {"residual": 0.0, "here": lam, "rest": 1.0, "best": fork.best()}.items():
                shown = float(state["table"][row][index])
                assert shown == pytest.approx(float(fork.faults(at)[name]), abs=6e-4)
        assert state["faults"]["best"] == pytest.approx(fork.best(), abs=1e-12)
        weights = state["sources"]["weights"]
        np.testing.assert_allclose(weights["top"], (0.9 * lam) ** np.array(weights["x"]), atol=1e-12)
        first = ", ".join(f"{(0.9 * lam) ** step:.3f}" for step in range(2))
        assert f"count with {first}" in state["note"]
        assert ("no λ has a bias" in state["note"]) == (missed == 0)
        assert ("nothing to the bias" in state["note"]) == (offset > 0)


def test_html_and_fallback() -> None:
    explorable = bias_and_variance(lam=0.9, missed=0.6, offset=0.0, visits=4)
    html = explorable.html(live=False)
    assert len(html) < 120_000
    assert (
        "the squared bias is 0.100 and the variance 0.224; the sum is smallest at λ = 0.92" in explorable.alt
    )
    for look in FAULTS.values():
        assert look.color in html
        assert look.label in html
    (state,) = run_js(CALL, points=[(0.9, 0.6, 0.0, 4)])
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    assert all(f'\\"name\\":\\"{name}\\"' in sources for name in state["ranges"])
    for control in bias_and_variance().controls:  # as a page starts: the arrow to the left moves something
        assert control.start < control.value
    top, low = explorable.fallback().axes
    lines = {line.get_label(): np.array(line.get_data()) for line in top.lines}
    for name, look in FAULTS.items():
        x, y = lines[look.label]
        source = state["sources"][name]
        np.testing.assert_allclose(np.interp(x, source["x"], source["y"]), y, atol=1e-9)
    heights = [bar.get_height() for bar in low.containers[0]]
    np.testing.assert_allclose(heights, state["sources"]["weights"]["top"])


@pytest.mark.parametrize(
    "bad", [{"lam": -0.1}, {"lam": 1.1}, {"missed": 1.5}, {"offset": -1.0}, {"visits": 0}]
)
def test_values_outside_the_sliders_are_refused(bad: dict) -> None:
    with pytest.raises(ValueError, match="choose"):
        bias_and_variance(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(FAULTS.values(), ground)
