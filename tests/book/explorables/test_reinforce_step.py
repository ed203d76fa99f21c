"""One step of REINFORCE: the explorable's JavaScript agrees with autograd, and its cloud does what the theorem says."""

import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
import torch
from scipy import stats

from inbounds.book.explorables.reinforce_step import POLICIES, StepOfReinforce, reinforce_step
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["reinforce-step"]'
CALL = f"points.map(([peak, draws, batch, share, rate]) => {MODEL}({{ peak, draws, batch, share, rate }}))"
RNG = np.random.default_rng(2)
# Corners of the sliders, and points in between: best latent, draws, batch, baseline, learning rate.
POINTS = [
    *itertools.product((-3.0, 0.0, 3.0), (1, 64), (1, 30), (0.0, 1.0), (0.1, 1.0)),
    *itertools.product((1.0,), (1,), (13, 20, 28), (0.0,), (1.0,)),
    *[
        (peak, int(draws), int(batch), share, rate)
        for peak, draws, batch, share, rate in RNG.uniform([-3, 1, 1, 0, 0.1], [3, 65, 31, 1, 1], (16, 5)).tolist()
    ],
]  # fmt: skip


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    return run_js(CALL, points=POINTS)  # type: ignore[no-any-return]


def test_gradients_are_autograd_s(states: list[dict[str, Any]]) -> None:
    """Exact: through the reward, without a score. Sampled: of mean weight times log-probability, as in the program."""
    for point, state in zip(POINTS, states, strict=True):
        step, found = StepOfReinforce(*point), state["found"]
        assert found["baseline"] == pytest.approx(step.baseline, abs=1e-12)
        np.testing.assert_allclose(found["gradient"], step.exact(), atol=1e-11)
        np.testing.assert_allclose(found["sampled"], step.sampled(), atol=1e-11)


def test_covariance_is_the_quadrature_s(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        step = StepOfReinforce(*point)
        (a, b), (_, c) = (step.covariance() * step.draws).tolist()
        np.testing.assert_allclose(state["found"]["covariance"], [a, b, c], atol=1e-10)
        spreads = step.rate * step.covariance().diagonal().sqrt()
        np.testing.assert_allclose(state["found"]["spreads"], spreads, rtol=1e-8)


def test_the_policy_after_the_step(states: list[dict[str, Any]]) -> None:
    """Learning rate, the program's clip of log σ, and what the new policy earns, by quadrature."""
    clipped = 0
    for point, state in zip(POINTS, states, strict=True):
        step, found = StepOfReinforce(*point), state["found"]
        parameters = [torch.zeros(2).double(), step.rate * step.sampled(), step.rate * step.exact()]
        for (loc, log_scale), name, value in zip(parameters, POLICIES, found["values"], strict=True):
            clipped += bool(log_scale > 1)
            log_scale = log_scale.clamp(-10, 1)
            law = found["laws"][name]
            assert law == pytest.approx({"mu": float(loc), "sigma": math.exp(log_scale)}, abs=1e-9)
            assert value == pytest.approx(float(step.expected(loc, log_scale)), abs=1e-9)
            x, y = (np.array(state["sources"][name][axis]) for axis in "xy")
            np.testing.assert_allclose(y, stats.norm.pdf(x, law["mu"], law["sigma"]), rtol=1e-9, atol=1e-300)
    assert clipped
    step = StepOfReinforce(rate=1.0)
    for gradient in (step.sampled(), step.exact(), torch.tensor([0.0, 3.0])):
        loc, scale = step.after(gradient)
        assert loc == float(gradient[0])
        assert scale == pytest.approx(math.exp(min(1.0, float(gradient[1]))))


def test_draws_are_one_and_the_same_and_normal(states: list[dict[str, Any]]) -> None:
    drawn = np.array(run_js("inbounds.reinforceStep.all"))
    assert drawn.shape == (200, 64)
    ours = [StepOfReinforce(draws=64, batch=k).latents().numpy() for k in range(1, 201)]
    np.testing.assert_allclose(drawn, ours, atol=1e-12)
    assert stats.kstest(drawn.ravel(), stats.norm.cdf).pvalue > 0.01
    for column in (0, 1, 2):
        assert stats.kstest(drawn[:, column], stats.norm.cdf).pvalue > 0.01
    assert np.abs(np.corrcoef(drawn[:-1].ravel(), drawn[1:].ravel())[0, 1]) < 0.03
    assert np.abs(np.corrcoef(drawn[:, :-1].ravel(), drawn[:, 1:].ravel())[0, 1]) < 0.03
    for point, state in zip(POINTS, states, strict=True):
        step = StepOfReinforce(*point)
        np.testing.assert_allclose(state["sources"]["draws"]["x"], step.latents(), atol=1e-12)
        np.testing.assert_allclose(state["sources"]["draws"]["y"], step.reward(step.latents()), atol=1e-12)


def test_the_cloud_stands_about_the_exact_gradient_with_its_spread(states: list[dict[str, Any]]) -> None:
    """Means within four standard errors, variances within what 200 batches can tell; the chosen batch is in it."""
    for point, state in zip(POINTS, states, strict=True):
        cloud = np.array([state["sources"]["cloud"][axis] for axis in "xy"])
        assert cloud.shape == (2, 200)
        np.testing.assert_allclose(cloud[:, point[2] - 1], state["found"]["sampled"], atol=1e-14)
        covariance = StepOfReinforce(*point).covariance().numpy()
        off = cloud.mean(axis=1) - state["found"]["gradient"]
        assert (np.abs(off) < 4 * np.sqrt(covariance.diagonal() / 200)).all()
        if abs(point[0]) < 2.5:  # beyond, a few rare draws make up the variance
            assert (np.abs(np.log(cloud.var(axis=1) / covariance.diagonal())) < 0.5).all()


def test_the_ellipse_is_two_standard_deviations(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        away = np.array([state["sources"]["ellipse"][axis] for axis in "xy"]).T - state["found"]["gradient"]
        covariance = StepOfReinforce(*point).covariance().numpy()
        squares = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)
        np.testing.assert_allclose(squares, 4, rtol=1e-6)


def test_a_baseline_changes_the_spread_and_nothing_else() -> None:
    """For every best latent: the exact gradient stays, and the mean as baseline takes variance; not always the most."""
    points = [
        (peak, 8, 1, share, 0.5) for peak in np.linspace(-3, 3, 13) for share in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    found = [state["found"] for state in run_js(CALL, points=points)]
    gradients = np.array([each["gradient"] for each in found]).reshape(13, 5, 2)
    np.testing.assert_allclose(gradients, gradients[:, :1] + np.zeros((1, 5, 1)), atol=1e-12)
    variances = np.array([each["covariance"][0] for each in found]).reshape(13, 5)
    assert (variances[:, -1] < 0.3 * variances[:, 0]).all()
    assert not (variances.argmin(axis=1) == 4).all()
    taken = np.array([each["taken"] for each in found]).reshape(13, 5)
    np.testing.assert_allclose(taken, 1 - variances / variances[:, :1], atol=1e-12)


def test_the_note_is_true(states: list[dict[str, Any]]) -> None:
    seen = set()
    for point, state in zip(POINTS, states, strict=True):
        before, sampled, exact = state["found"]["values"]
        verbs = [
            "raises" if v > before + 5e-4 else "lowers" if v < before - 5e-4 else "hardly changes"
            for v in (sampled, exact)
        ]
        assert f"batch's step {verbs[0]} the expected reward" in state["note"]
        assert ("so does" in state["note"]) == (verbs[0] == verbs[1])
        assert ("No baseline" in state["note"]) == (point[3] == 0)
        seen.add(verbs[0])
    assert len(seen) == 3


def test_table_html_and_fallback(states: list[dict[str, Any]]) -> None:
    explorable = reinforce_step(draws=16, batch=5, share=0.5, rate=0.5)
    assert len(explorable.html(live=False)) < 140_000  # five sliders and three plots
    step = StepOfReinforce(draws=16, batch=5, share=0.5)
    assert (
        f"gradient in μ is {float(step.sampled()[0]):.2f} from this batch and 0.29 exactly" in explorable.alt
    )
    (state,) = run_js(CALL, points=[(1.5, 16, 5, 0.5, 0.5)])
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    for control in reinforce_step().controls:  # as a page starts: the arrow to the left moves something
        assert control.start + control.step < control.value
    top, middle, below = explorable.fallback().axes
    for name, look in POLICIES.items():
        (line,) = [line for line in middle.lines if line.get_label() == look.label]
        x, y = line.get_data()
        np.testing.assert_allclose(y, np.interp(x, *state["sources"][name].values()), atol=2e-3)
    np.testing.assert_allclose(top.lines[2].get_xdata(), state["sources"]["draws"]["x"], atol=1e-12)
    np.testing.assert_allclose(below.lines[0].get_data(), list(state["sources"]["cloud"].values()), atol=1e-9)
    for point, each in zip(POINTS, states, strict=True):
        shown = [float(cell.replace("−", "-")) for cell in each["table"]["expected"]]
        assert shown == pytest.approx(each["found"]["values"], abs=6e-4)
        for axis, row in enumerate(("step_loc", "step_log_scale")):
            steps = [float(cell.replace("−", "-")) for cell in each["table"][row][1:]]
            found = each["found"]
            assert steps == pytest.approx(
                [point[4] * found[kind][axis] for kind in ("sampled", "gradient")], abs=6e-4
            )


@pytest.mark.parametrize(
    "bad", [{"peak": 3.5}, {"draws": 0}, {"draws": 65}, {"batch": 31}, {"share": 1.1}, {"rate": 0.0}]
)
def test_values_outside_the_sliders_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="choose peak in"):
        reinforce_step(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(POLICIES.values(), ground, lightness_gap=7)
