"""What a stored action gives back: the explorable's JavaScript, its Python, PyTorch's formats and mpmath agree."""

import itertools
import json
import math

import mpmath
import numpy as np
import pytest
import torch
from torch.distributions import Normal

from inbounds.book.explorables.stored_action import FORMATS, LATENTS, StoredAction, stored_action
from inbounds.distributions import LogitNormal
from inbounds.study.running.play_records import RECORDS
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["stored-action"]'
CALL = f"points.map(([z, noise, log_sigma, form]) => {MODEL}({{ z, noise, log_sigma, form }}))"
RNG = np.random.default_rng(8)
# On both sides of each format's limit, the sliders' ends, and points in between: (z, noise, log σ, format).
LIMITS = [(bits + 2) * math.log(2) for bits in FORMATS.values()]
POINTS = [
    *[(at + side, 1.0, -0.7, i) for i, at in enumerate(LIMITS) for side in (-1.5, -0.6, -0.01, 0.01, 1.5)],
    *itertools.product((2.0, 40.0), (-2.0, 0.0, 2.0), (-3.0, 0.0), range(4)),
    (16.5, 1.0, math.log(0.5), 2),
    *[(*RNG.uniform([2.0, -2.0, -3.0], [40.0, 2.0, 0.0]).tolist(), i % 4) for i in range(40)],
]


@pytest.fixture(scope="module")
def states() -> list[dict]:
    return run_js(CALL, points=POINTS)


def ours(point: tuple[float, float, float, int]) -> StoredAction:
    z, noise, log_sigma, form = point
    return StoredAction(z, noise, math.exp(log_sigma), list(FORMATS)[form])


def test_javascript_agrees(states: list[dict]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        expected, found = ours(point), state["record"]
        if expected.steps < 2**40:
            assert found["steps"] == expected.steps
        else:  # float64 near the centre: exp's own last digit is a spacing
            assert abs(found["steps"] - expected.steps) <= 1
        recalled = float(found["recalled"])
        assert recalled == pytest.approx(expected.recalled, rel=1e-12)
        for end, edge in zip(found["cell"], expected.cell, strict=True):  # JSON has no infinity: null
            assert (math.inf if end is None else end) == pytest.approx(edge, rel=1e-12)
        assert found["ratio"] == pytest.approx(expected.ratio, rel=1e-9, abs=1e-12)
        assert found["mu"] == pytest.approx(expected.loc, abs=1e-12)


@pytest.mark.parametrize("form", list(FORMATS))
def test_the_stored_number_is_the_format_s(form: str) -> None:
    """Bit for bit PyTorch's conversion, and in the reader's browser Math.fround."""
    dtype = getattr(torch, form)
    latents = np.linspace(2.0, 40.0, 3001)
    stored = torch.tanh(torch.from_numpy(latents) / 2).to(dtype).double().numpy()
    numbers = np.array([1 - StoredAction(z, form=form).steps * 2.0 ** -FORMATS[form] for z in latents])
    if form == "float64":  # tanh and exp round in the format itself
        np.testing.assert_allclose(numbers, stored, rtol=0, atol=2.0**-53)
    else:
        np.testing.assert_array_equal(numbers, stored)
    if form == "float32":
        np.testing.assert_array_equal(
            run_js("z.map((z) => Math.fround(Math.tanh(z / 2)))", z=latents.tolist()), numbers
        )


def test_double_precision_against_fifty_digits() -> None:
    with mpmath.workdps(50):
        for z in np.linspace(12.0, 38.0, 200):
            exact = mpmath.nint(2 / (1 + mpmath.exp(mpmath.mpf(float(z)))) * 2**53)
            assert StoredAction(float(z), form="float64").steps == int(exact)


def test_a_program_in_single_precision_stores_the_same() -> None:
    """The chapter's tanh and the package's map, in float32 throughout: at most one spacing from the nearest."""
    latents = np.arange(2 * 8, 40 * 8) / 8  # exact in float32
    z = torch.tensor(latents, dtype=torch.float32)
    nearest = np.array([StoredAction(float(each)).steps for each in latents])
    by_tanh = ((1 - torch.tanh(z / 2).double()) * 2**24).numpy()
    assert np.abs(by_tanh - nearest).max() <= 1
    assert (by_tanh == nearest)[latents >= 8].mean() > 0.98
    law = LogitNormal(torch.zeros(()), torch.ones(()), low=-1.0, high=1.0)
    by_map = ((1 - law.latent_to_value(z).double()) * 2**24).numpy()
    assert np.abs(by_map - np.maximum(nearest, 1)).max() <= 1  # a sample is never on a bound


def test_what_comes_back_is_the_study_s_and_the_ratio_torch_s() -> None:
    for form, z, scale in itertools.product(
        ("bfloat16", "float16", "float32", "float64"), (3.0, 6.2, 14.3, 17.1), (0.1, 1.0)
    ):
        action = StoredAction(z, -0.7, scale, form)
        if action.steps == 0:
            assert action.recalled == math.inf
            assert action.ratio == 0
            continue
        record = RECORDS[f"action, {form}"]
        assert record is not None
        latent = torch.tensor([z], dtype=torch.float64)
        back = record.recalled(latent)
        assert action.recalled == pytest.approx(back.item(), rel=1e-9)
        law = Normal(torch.tensor(action.loc, dtype=torch.float64), scale)
        log_ratio = (law.log_prob(back) - law.log_prob(latent)).item()
        assert math.log(action.ratio) == pytest.approx(log_ratio, rel=1e-5, abs=1e-8)
        error = action.recalled - z
        assert math.log(action.ratio) == pytest.approx(
            0.7 * error / scale - error**2 / (2 * scale**2), abs=1e-9
        )


def test_the_theorem_holds() -> None:
    for form, bits in FORMATS.items():
        spacing, limit = 2.0**-bits, math.log(4 * 2.0**bits - 1)
        assert StoredAction(limit - 0.001, form=form).steps == 1
        assert StoredAction(limit + 0.001, form=form).recalled == math.inf
        for z in np.linspace(2.0, limit - 0.1, 50):
            action = StoredAction(float(z), form=form)
            low, high = action.cell
            assert low - 1e-12 <= z <= high + 1e-12
            y = 2 / (1 + math.exp(z))
            if form != "float64":  # there the bound is below a double's own rounding
                assert abs(action.recalled - z) <= spacing / (2 * y - spacing) + spacing / 3
                inside = [StoredAction(low + share * (high - low), form=form).steps for share in (0.05, 0.95)]
                assert inside == [action.steps] * 2


def test_what_the_picture_shows(states: list[dict]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        action, sources = ours(point), state["sources"]
        left, right = state["ranges"]["x"]
        assert left < action.z < right
        assert state["ranges"]["y"][0] == 0
        assert max(sources["density"]["y"]) < state["ranges"]["y"][1]
        for tick in sources["ticks"]["x0"]:
            assert left <= tick <= right
            again = StoredAction(tick, form=action.form)
            assert again.recalled == pytest.approx(tick, abs=1e-9)  # a tick comes back as it was
        height = sources["drawn-top"]["y"][0]
        assert height == pytest.approx(math.exp(action.log_density(action.z)), rel=1e-9)
        if action.steps:
            assert sources["recalled-top"]["y"][0] / height == pytest.approx(
                action.ratio, rel=1e-6, abs=1e-12
            )
            assert "representable number" in state["note"]
            assert state["table"]["latent"][1] == f"{action.recalled:.3f}"
        else:
            assert sources["recalled"] == {"x": [], "y": []}
            assert "the bound itself" in state["note"]
            assert [cells[1] for cells in state["table"].values()] == [
                "∞", "1, the bound", "0", "−∞", "∞", "0.000",
            ]  # fmt: skip


def test_html_and_fallback() -> None:
    explorable = stored_action()
    html = explorable.html(live=False)
    assert len(html) < 120_000
    assert "float32 gives back 16.64, and the ratio at unchanged parameters is 0.74" in explorable.alt
    for look in LATENTS.values():
        assert look.color in html
        assert look.label in html
    (state,) = run_js(CALL, points=[(16.5, 1.0, math.log(0.5), 2)])
    assert set(state["table"]) == set(explorable.rows)
    assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
    sources = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in sources for source in state["sources"])
    assert all(f'\\"name\\":\\"{name}\\"' in sources for name in state["ranges"])
    for control in explorable.controls:  # as a page starts: the arrow to the left moves something
        assert control.start < control.value
    (ax,) = explorable.fallback().axes
    assert ax.get_xlim() == pytest.approx(state["ranges"]["x"])
    stems = {line.get_label(): np.array(line.get_data()) for line in ax.lines}
    for name, look in LATENTS.items():
        np.testing.assert_allclose(stems[look.label], [state["sources"][name][axis] for axis in "xy"])
    lost = stored_action(z=30.0).fallback().axes[0]
    assert LATENTS["recalled"].label not in [line.get_label() for line in lost.lines]


@pytest.mark.parametrize("bad", [{"z": 1.0}, {"noise": 3.0}, {"sigma": 0.01}, {"form": "float8"}])
def test_values_outside_the_sliders_are_refused(bad: dict) -> None:
    with pytest.raises(ValueError, match="choose"):
        stored_action(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ(LATENTS.values(), ground)
