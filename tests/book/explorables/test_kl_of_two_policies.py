"""Two policies under three maps: the JavaScript agrees with the package, and says what the theorem says."""

from typing import Any

import numpy as np
import pytest
import torch
from torch.distributions import Normal

from inbounds.book.drawing import figures
from inbounds.book.explorables.kl_of_two_policies import (
    MAPS,
    TwoPolicies,
    kl_of_two_policies,
)
from inbounds.distributions import ClippedNormal
from tests.book.explorables.test_bounded_densities import run_js

RNG = np.random.default_rng(5)
# Corners of the sliders, equal policies, and points in between.
POINTS = [
    (0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.8, -0.35),
    (-3.0, 1.0, 3.0, 1.0),
    (3.0, -2.0, 2.5, -1.5),
    (-3.0, 1.0, 3.0, -2.0),
    (0.0, -2.0, 0.0, 0.0),
    *[
        tuple(
            float(x) for x in (RNG.uniform(-3, 3), RNG.uniform(-1, 1), RNG.uniform(-3, 3), RNG.uniform(-1, 1))
        )
        for _ in range(12)
    ],
]
NAMES = ("mu_old", "log_sigma_old", "mu_new", "log_sigma_new")


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    model = 'inbounds.models["kl-of-two-policies"]'
    controls = [dict(zip(NAMES, point, strict=True)) for point in POINTS]
    return run_js(f"controls.map((c) => {model}(c))", controls=controls)


def policies(point: tuple[float, ...]) -> TwoPolicies:
    return TwoPolicies((point[0], float(np.exp(point[1]))), (point[2], float(np.exp(point[3]))))


def test_divergences_are_the_package_s(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        for family in MAPS:
            found = state["results"][family]
            exact = policies(point).kl(family)
            np.testing.assert_allclose(
                [found["kl"], found["reverse"]], exact, rtol=5e-6, atol=1e-7, err_msg=f"{family} {point}"
            )


def test_the_squash_leaves_divergence_and_variation_alone(states: list[dict[str, Any]]) -> None:
    """The squashed pair is integrated over actions: that the numbers agree is the theorem, not the code."""
    for state in states:
        drawn, squashed, clipped = (state["results"][family] for family in MAPS)
        for name in ("kl", "reverse", "variation"):
            assert squashed[name] == pytest.approx(drawn[name], rel=5e-6, abs=1e-7)
            assert clipped[name] <= drawn[name] + 1e-4


def test_variation_of_equal_scales() -> None:
    """For N(0, 1) and N(d, 1) the total variation is 2Φ(d/2) − 1."""
    state = run_js(
        'inbounds.models["kl-of-two-policies"]({ mu_old: 0, log_sigma_old: 0, mu_new: 1, log_sigma_new: 0 })'
    )
    exact = 2 * float(Normal(0.0, 1.0).cdf(torch.tensor(0.5))) - 1
    assert state["results"]["gaussian"]["variation"] == pytest.approx(exact, abs=1e-5)


def test_entropies_and_means(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        for family in MAPS:
            laws = policies(point).laws(family)
            found = state["results"][family]
            np.testing.assert_allclose(
                found["entropy"],
                [float(law.entropy()) for law in laws],
                atol=2e-3,
                err_msg=f"{family} {point}",
            )
            np.testing.assert_allclose(found["mean"], [float(law.mean) for law in laws], atol=1e-9)


def test_curves_and_masses_are_laws(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        for family in MAPS:
            for i, role in enumerate(("old", "new")):
                source = state["sources"][f"{family}-{role}"]
                x, y = np.array(source["x"]), np.array(source["y"])
                assert (np.diff(x) > 0).all()
                law = policies(point).laws(family)[i]
                mass = float(np.trapezoid(y, x))
                if isinstance(law, ClippedNormal):
                    atoms = state["sources"][f"atoms-{role}"]["mass"]
                    np.testing.assert_allclose(atoms, [float(law.mass_low), float(law.mass_high)], atol=1e-12)
                    mass += sum(atoms)
                assert mass == pytest.approx(1, abs=1e-3)


def test_table_and_note(states: list[dict[str, Any]]) -> None:
    explorable = kl_of_two_policies()
    for state in states:
        assert set(state["table"]) == set(explorable.rows)
        assert {len(cells) for cells in state["table"].values()} == {len(MAPS)}
        assert set(state["ranges"]) == {f"y-{family}" for family in MAPS}
        kl = float(state["table"]["kl"][0].replace("−", "-"))
        assert kl == pytest.approx(state["results"]["gaussian"]["kl"], rel=6e-3, abs=6e-4)
        assert state["table"]["kl"][0] == state["table"]["kl"][1]
        assert ("the same" in state["note"]) == (kl == 0)
        means = [state["table"][f"mean_{role}"] for role in ("old", "new")]
        assert ("means differ" in state["note"]) == (kl > 0 and any(len(set(cells)) > 1 for cells in means))
    assert "KL" not in states[0]["note"]


def test_static_figure_and_alt_text_say_the_same() -> None:
    explorable = kl_of_two_policies(old=(0.0, 1.0), new=(1.0, 1.0))
    assert "0.500 nats as drawn, 0.500 squashed and 0.467 clipped" in explorable.alt
    fig = explorable.fallback()
    assert [ax.get_title() for ax in fig.axes] == [
        "as drawn: 0.500 nats",
        "squashed: 0.500 nats",
        "clipped: 0.467 nats",
    ]
    colors = {line.get_color() for ax in fig.axes for line in ax.lines if line.get_linewidth() > 1}
    assert colors == {figures.LOOKS[family].color for family in MAPS}


def test_initial_values_are_the_sliders() -> None:
    explorable = kl_of_two_policies(old=(0.5, 2.0), new=(-1.0, 0.5))
    assert [control.name for control in explorable.controls] == list(NAMES)
    values = [control.value for control in explorable.controls]
    np.testing.assert_allclose(values, [0.5, np.log(2.0), -1.0, np.log(0.5)])


@pytest.mark.parametrize("bad", [(4.0, 1.0), (0.0, 3.0), (0.0, 0.1), (0.0, -1.0)])
def test_values_outside_the_sliders_are_refused(bad: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="choose mu in"):
        kl_of_two_policies(old=bad)
    with pytest.raises(ValueError, match="new"):
        kl_of_two_policies(new=bad)
