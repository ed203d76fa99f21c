"""Many steps on one batch: the JavaScript, autograd on the package's surrogate, and the proposition agree."""

import json
import math
from typing import Any

import numpy as np
import pytest
import torch
from scipy import stats

from inbounds.book.explorables.one_batch import CURVES, OneBatch, one_batch
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["one-batch"]'
CALL = f"points.map(([steps, draws, noise, batch]) => {MODEL}({{ steps, draws, noise, batch }}))"
POINTS = [
    *((steps, 20, 1.0, 10) for steps in (0, 60, 100)),
    *((100, 10, noise, batch) for noise in (0.0, 0.5) for batch in (1, 7)),
    (30, 200, 1.0, 20), (100, 200, 0.0, 3), (80, 60, 0.7, 13),
]  # fmt: skip
KEYS = ("mu", "sigma", "promise", "truth", "effective", "kl")


def short(nats: float) -> str:
    """Two digits, or all before the point, as JavaScript's `toPrecision` writes them."""
    return f"{nats:.0f}" if nats >= 10 else f"{nats:#.2g}"


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    return run_js(CALL, points=POINTS)  # type: ignore[no-any-return]


def test_the_batch_is_the_same_in_both_languages(states: list[dict[str, Any]]) -> None:
    for (_, draws, noise, batch), state in zip(POINTS, states, strict=True):
        action, estimate = OneBatch(draws, noise, batch).drawn()
        np.testing.assert_allclose([each["a"] for each in state["batch"]], action, atol=1e-12)
        np.testing.assert_allclose([each["estimate"] for each in state["batch"]], estimate, atol=1e-12)
        assert float(estimate.mean()) == pytest.approx(0, abs=1e-12)


def test_draws_are_normal_and_independent() -> None:
    draws = [OneBatch(200, 1.0, batch).drawn() for batch in range(1, 21)]
    action = torch.cat([each[0] for each in draws]).numpy() / 0.5
    motor = OneBatch.motor
    error = torch.cat([each[1] for each in draws]).numpy() - np.exp(-2 * (0.5 * action - motor.peak) ** 2)
    assert stats.kstest(action, "norm").pvalue > 0.01
    assert stats.kstest((error - error.mean()) / error.std(), "norm").pvalue > 0.01
    assert error.std() == pytest.approx(1, abs=0.05)
    assert abs(np.corrcoef(action, error)[0, 1]) < 4 / math.sqrt(len(action))


def test_javascript_climbs_as_autograd_does(states: list[dict[str, Any]]) -> None:
    for (_, draws, noise, batch), state in zip(POINTS, states, strict=True):
        path = OneBatch(draws, noise, batch).climb()
        for key in KEYS:
            found = [at[key] for at in state["path"]]
            np.testing.assert_allclose(
                found, path[key], rtol=1e-6, atol=1e-8, err_msg=f"{key} {draws} {noise} {batch}"
            )


def test_every_step_is_uphill_and_of_one_length(states: list[dict[str, Any]]) -> None:
    for state in states:
        path = {key: np.array([at[key] for at in state["path"]]) for key in KEYS}
        assert (np.diff(path["promise"]) > -1e-3).all()
        move = np.diff(path["mu"]) / path["sigma"][:-1], np.diff(np.log(path["sigma"]))
        np.testing.assert_allclose(move[0] ** 2 / 2 + move[1] ** 2, 0.001, rtol=1e-9)


def test_without_a_look_at_the_batch_the_surrogate_is_right_on_average() -> None:
    """At a fixed policy its mean over batches is the true gain, times 1 − 1/n for the mean that is subtracted."""
    draws, mu, sigma = 20, 0.2, 0.4
    motor = OneBatch.motor
    step = torch.tensor([mu, math.log(sigma / motor.sigma)], dtype=torch.float64)
    truth = float(motor.worth(step) - motor.worth(torch.zeros_like(step)))
    found = []
    for batch in range(1, 3001):
        action, estimate = (values.numpy() for values in OneBatch(draws, 1.0, batch).drawn())
        ratio = stats.norm.pdf(action, mu, sigma) / stats.norm.pdf(action, 0.0, motor.sigma)
        found.append(np.mean(ratio * estimate))
    standard_error = np.std(found) / math.sqrt(len(found))
    assert standard_error < 0.1 * truth
    assert np.mean(found) == pytest.approx((1 - 1 / draws) * truth, abs=4 * standard_error)


def test_what_the_chapter_says_of_the_first_batch() -> None:
    """More is promised than any policy can gain, with true advantages too; what is earned falls below nothing."""
    most = 1 - float(OneBatch.motor.worth(torch.zeros(2, dtype=torch.float64)))
    noisy, true = (OneBatch(20, noise, 10).climb() for noise in (1.0, 0.0))
    assert noisy["promise"][60] > 2 * most
    assert noisy["truth"][60] < 0 < noisy["truth"].max()
    assert true["promise"][-1] > most > true["truth"].max()
    assert np.argmax(noisy["kl"] > 0.03) < np.argmax(noisy["truth"])


def test_table_note_and_ranges(states: list[dict[str, Any]]) -> None:
    explorable = one_batch()
    seen = set()
    for (steps, draws, _, _), state in zip(POINTS, states, strict=True):
        assert set(state["table"]) == set(explorable.rows)
        assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
        path = state["path"]
        brake = next(k for k, at in enumerate(path) if at["kl"] > 0.03)
        assert state["table"]["at"] == [str(steps), str(brake)]
        for key, digits in (("promise", 2), ("truth", 2), ("effective", 1), ("kl", 3)):
            shown = [float(cell.replace("−", "-")) for cell in state["table"][key]]
            expected = [path[k][key] for k in (steps, brake)]
            assert shown == pytest.approx(expected, abs=0.51 * 10.0**-digits)
        most = state["sources"]["most"]["y"][0]
        assert most == pytest.approx(1 - float(OneBatch.motor.worth(torch.zeros(2, dtype=torch.float64))))
        assert f"more than {most:.2f}" in state["note"]
        assert ("impossible" in state["note"]) == (path[steps]["promise"] > most)
        seen.add("impossible" in state["note"])
        assert f"Of {draws} draws" in state["note"]
        best = int(np.argmax([at["truth"] for at in path]))
        assert (f"largest after {best} step" in state["note"]) == (0 < best < 100)
        nats = f"{steps} of them are {short(path[steps]['kl'])} nats from the old policy"
        assert (nats in state["note"]) == (steps > 1)
        low, high = state["ranges"]["gain"]
        assert low < min(*state["sources"]["truth"]["y"], 0) < most < high
        low, high = state["ranges"]["paid"]
        for source in ("drawn", "advantage", "old", "new"):
            y = np.array(state["sources"][source]["y"])
            assert low - 1e-9 <= y.min()
            assert y.max() <= high + 1e-9
    assert seen == {True, False}


def test_circles_have_the_weights_as_areas(states: list[dict[str, Any]]) -> None:
    for (steps, _, _, _), state in zip(POINTS, states, strict=True):
        at = state["path"][steps]
        action = np.array([each["a"] for each in state["batch"]])
        ratio = stats.norm.pdf(action, at["mu"], at["sigma"]) / stats.norm.pdf(action, 0.0, 0.5)
        size = np.array(state["sources"]["drawn"]["size"])
        np.testing.assert_allclose(size, np.clip(8 * np.sqrt(ratio), 2, 60), rtol=1e-6)


def test_html_and_fallback() -> None:
    explorable = one_batch(steps=50, draws=30, noise=0.5, batch=4)
    html = explorable.html(live=False)
    assert len(html) < 160_000
    (state,) = run_js(CALL, points=[(50, 30, 0.5, 4)])
    now = state["path"][50]
    assert f"promises {now['promise']:.2f}, the policy gains {now['truth']:.2f}" in explorable.alt
    document = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in document for source in state["sources"])
    upper, lower = explorable.fallback().axes
    lines = {line.get_label(): np.array(line.get_ydata()) for line in upper.lines}
    for name in ("promise", "truth"):
        np.testing.assert_allclose(
            lines[CURVES[name].label], state["sources"][name]["y"], rtol=1e-6, atol=1e-8
        )
    for name in ("now", "brake"):
        (line,) = (line for line in upper.lines if line.get_label() == CURVES[name].label)
        assert line.get_xdata()[0] == state["sources"][name]["x"][0]
    places = np.array(lower.collections[0].get_offsets())
    drawn = state["sources"]["drawn"]
    np.testing.assert_allclose(places, np.stack([drawn["x"], drawn["y"]], -1), atol=1e-9)


@pytest.mark.parametrize("bad", [{"steps": 101}, {"draws": 5}, {"noise": 2.0}, {"batch": 0}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="choose"):
        one_batch(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(CURVES.values(), ground)
