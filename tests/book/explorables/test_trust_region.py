"""The trust region's explorable: its JavaScript, the family's divergence, quadrature and the package's TRPO agree."""

import dataclasses
import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
import torch

from inbounds.book.explorables.trust_region import REGIONS, STEPS, OneMotor, trust_region
from inbounds.learning import NetworkConfig, Policy, PolicyConfig, TRPOConfig
from inbounds.learning.networks import ActorCritic
from inbounds.learning.trpo import line_search, natural_step
from inbounds.learning.updates.minibatches import Minibatch
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["trust-region"]'
CALL = f"points.map(([log_sigma, peak, log_max_kl]) => {MODEL}({{ log_sigma, peak, log_max_kl }}))"
RNG = np.random.default_rng(12)
# Corners of the sliders, and points in between.
POINTS = [
    *itertools.product((-2.3, -0.35), (-1.0, 0.0, 1.0), (-4.6, -0.7)),
    *RNG.uniform([-2.3, -1.0, -4.6], [-0.35, 1.0, -0.7], (14, 3)).tolist(),
]


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    return run_js(CALL, points=POINTS)  # type: ignore[no-any-return]


def motor(point: list[float]) -> OneMotor:
    return OneMotor(math.exp(point[0]), point[1], math.exp(point[2]))


def test_the_worth_is_the_mean_reward() -> None:
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    for point in POINTS:
        one = motor(point)
        for step in ([0.0, 0.0], [0.2, -0.3], [-0.1, 0.4]):
            action = step[0] + one.sigma * math.exp(step[1]) * nodes
            expected = weights @ np.exp(-2 * (action - one.peak) ** 2) / math.sqrt(2 * math.pi)
            assert float(one.worth(torch.tensor(step, dtype=torch.float64))) == pytest.approx(
                expected, abs=1e-9
            )


def test_javascript_agrees_with_the_family_and_autograd(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        one = motor(point)
        np.testing.assert_allclose(state["found"]["b"], one.slope().numpy(), atol=1e-12)
        start = one.worth(torch.zeros(2, dtype=torch.float64))
        for name, step in one.steps().items():
            found = state["found"][name]
            np.testing.assert_allclose(found["step"], step, atol=1e-11)
            x = torch.from_numpy(step)
            assert found["predicted"] == pytest.approx(float(one.slope() @ x), abs=1e-12)
            assert found["gain"] == pytest.approx(float(one.worth(x) - start), abs=1e-12)
            assert found["exact"] == pytest.approx(float(one.kl(x)), abs=1e-12)
            assert found["quadratic"] == pytest.approx(one.max_kl, rel=1e-9)


def test_edges_lie_where_the_divergences_reach_the_bound(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        one, half = motor(point), state["ranges"]["x"][1]
        x = torch.tensor([[state["sources"][name][axis] for axis in "xy"] for name in ("exact", "quadratic")])
        exact, ellipse = x.double().mT
        torch.testing.assert_close(
            one.kl(exact), torch.full_like(exact[:, 0], one.max_kl), rtol=1e-5, atol=1e-6
        )
        quadratic = torch.einsum("ni,ij,nj->n", ellipse, one.fisher(), ellipse) / 2
        torch.testing.assert_close(quadratic, torch.full_like(quadratic, one.max_kl), rtol=1e-5, atol=1e-6)
        assert x.abs().max() < half
        assert state["ranges"]["x"] == state["ranges"]["y"]  # a right angle looks like one


def test_the_line_of_equal_gain_touches_the_ellipse(states: list[dict[str, Any]]) -> None:
    for state in states:
        b = np.array(state["found"]["b"])
        best = state["found"]["natural"]["predicted"]
        line = np.array([state["sources"]["level"][axis] for axis in "xy"])
        np.testing.assert_allclose(b @ line, best, atol=1e-9)
        gains = b @ np.array([state["sources"]["quadratic"][axis] for axis in "xy"])
        assert gains.max() <= best + 1e-12
        assert gains.max() == pytest.approx(best, rel=1e-3)
        assert state["found"]["plain"]["predicted"] <= best + 1e-12


def test_the_natural_step_and_the_line_search_are_those_of_the_package(states: list[dict[str, Any]]) -> None:
    """A network that knows no state but its last layer's bias, and a batch that is a quadrature rule."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    for point, state in zip(POINTS, states, strict=True):
        one, found = motor(point), state["found"]["natural"]
        policy = Policy(PolicyConfig("gaussian"), low=-np.ones(1), high=np.ones(1))
        shape = NetworkConfig(hidden_sizes=(2,), dtype="float64")
        networks = ActorCritic(policy, 1, shape, [torch.Generator().manual_seed(0)])
        networks.actor.theta.zero_()
        networks.actor.theta[0, -1] = point[0]  # log σ
        obs = torch.zeros(1, len(nodes), 1, dtype=torch.float64)
        latent = torch.from_numpy(one.sigma * nodes)[None, :, None]
        with torch.no_grad():
            log_prob = policy.law.log_prob(networks.parameters(obs), latent)
        reward = torch.exp(-2 * (latent[..., 0] - one.peak) ** 2)
        mean = float(one.worth(torch.zeros(2, dtype=torch.float64)))
        share = torch.from_numpy(weights / math.sqrt(2 * math.pi) * len(nodes))
        advantage = share * (reward - mean)
        steps = Minibatch(obs, latent, log_prob, advantage, return_=log_prob)
        config = TRPOConfig(entropy_coef=0.0, damping=0.0, max_kl=one.max_kl)
        step = natural_step(networks, steps, advantage, config)
        np.testing.assert_allclose(step[0, -2:], found["step"], rtol=2e-5, atol=1e-6)
        np.testing.assert_allclose(step[0, :-2], 0.0, atol=1e-12)
        search = line_search(networks, steps, advantage, step, config)
        assert float(search.fraction) == found["kept"]


def test_table_and_note(states: list[dict[str, Any]]) -> None:
    explorable = trust_region()
    seen = set()
    for point, state in zip(POINTS, states, strict=True):
        assert set(state["table"]) == set(explorable.rows)
        assert {len(cells) for cells in state["table"].values()} == {len(STEPS)}
        for key in ("predicted", "gain", "quadratic", "exact"):
            shown = [float(cell.replace("−", "-")) for cell in state["table"][key]]
            assert shown == pytest.approx([state["found"][name][key] for name in STEPS], abs=6e-5)
        within = state["found"]["natural"]["exact"] <= math.exp(point[2])
        assert ("within the bound" in state["note"]) == within
        seen.add(within)
        if not within:
            over = state["found"]["natural"]["exact"] / math.exp(point[2])
            assert (f"{over:.2f} times the bound" if over >= 1.005 else "just above the bound") in state[
                "note"
            ]
        cost = math.exp(-2 * point[0]) / 2
        told = f"costs {cost:.1f} times as" if cost < 10 else f"costs {cost:.0f} times as"
        assert (told in state["note"]) == (cost >= 1.05)
        plain, natural = (np.array(state["found"][name]["step"]) for name in STEPS)
        turn = abs(np.cross([*plain, 0], [*natural, 0])[2]) / np.linalg.norm(plain) / np.linalg.norm(natural)
        assert ("points elsewhere" in state["note"]) == (turn >= 0.05)
    assert seen == {True, False}


def test_the_note_does_not_call_two_ways_alike_that_the_picture_shows_apart() -> None:
    """A narrow policy: hardly any gain is lost by the plain gradient, and yet it points 30° away."""
    (state,) = run_js(CALL, points=[(-2.3, 0.35, -2.3)])
    plain, natural = (state["found"][name] for name in STEPS)
    ways = [math.degrees(math.atan2(step["step"][1], step["step"][0])) for step in (plain, natural)]
    assert abs(ways[0] - ways[1]) > 20
    assert plain["predicted"] > 0.98 * natural["predicted"]
    assert "points elsewhere" in state["note"]


def test_a_line_search_keeps_what_the_page_says(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        one = motor(point)
        for name, step in one.steps().items():
            assert one.kept(step) == state["found"][name]["kept"], point


def test_where_the_ellipse_is_a_circle_both_steps_are_one() -> None:
    (state,) = run_js(CALL, points=[(math.log(0.5) / 2, 0.4, -2.0)])
    np.testing.assert_allclose(state["found"]["plain"]["step"], state["found"]["natural"]["step"], atol=1e-12)


def test_html_and_fallback() -> None:
    explorable = trust_region(sigma=0.2, peak=0.3, max_kl=0.05)
    html = explorable.html(live=False)
    assert len(html) < 120_000
    assert html.count('<th scope="row"><svg') == len(REGIONS)  # their lines stand beside their rows
    (state,) = run_js(CALL, points=[(math.log(0.2), 0.3, math.log(0.05))])
    plain, natural = (state["found"][name]["predicted"] for name in STEPS)
    assert f"the plain step is promised {plain:.3f}, the natural step {natural:.3f}" in explorable.alt
    document = json.dumps(explorable._item)
    assert all(f'\\"name\\":\\"{source}\\"' in document for source in state["sources"])
    lines = {line.get_label(): line.get_data() for line in explorable.fallback().axes[0].lines}
    for look in (STEPS | REGIONS).values():
        assert look.color in html
        assert look.label in lines
    for name, look in STEPS.items():
        np.testing.assert_allclose([end[-1] for end in lines[look.label]], state["found"][name]["step"])
    radii = []
    for x, y in (lines[REGIONS["exact"].label], [state["sources"]["exact"][axis] for axis in "xy"]):
        wide = np.array(x) / 0.2
        angle = np.arctan2(y, wide)
        order = np.argsort(angle)
        radii.append(np.interp(np.linspace(-3, 3, 50), angle[order], np.hypot(wide, y)[order]))
    np.testing.assert_allclose(radii[0], radii[1], rtol=2e-3)


@pytest.mark.parametrize("bad", [{"sigma": 0.05}, {"sigma": 1.0}, {"peak": 1.5}, {"max_kl": 0.6}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="choose"):
        trust_region(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    """Four colours; steps and edges are drawn differently, and have line styles of their own."""
    assert_looks_differ(STEPS.values(), ground)
    assert_looks_differ(REGIONS.values(), ground)
    everything = enumerate((STEPS | REGIONS).values())
    assert_looks_differ([dataclasses.replace(look, linestyle=str(i)) for i, look in everything], ground)
