"""Quadrature under a Normal: which rule is right where, against mpmath and a brute-force rule."""

import math

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given
from scipy.special import roots_hermitenorm
from torch import Tensor
from torch.nn.functional import logsigmoid

from inbounds.distributions import expectation, gauss_hermite, graded_trapezoid, trapezoid

from .families import double, few, floats

LOCS = (-15.0, -3.0, 0.0, 0.4, 2.0, 15.0)


def exact_mean(loc: float, scale: float) -> float:
    """E[sigmoid(z)] to thirty digits."""
    with mpmath.workdps(30):
        m, s = mpmath.mpf(loc), mpmath.mpf(scale)
        cuts = sorted({mpmath.mpf(-14), -5, -1, 0, 1, 5, 14, max(-14, min(14, -m / s))})
        return float(mpmath.quad(lambda x: mpmath.npdf(x) / (1 + mpmath.exp(-m - s * x)), cuts))


@pytest.mark.parametrize("rule", [trapezoid(), gauss_hermite(40), graded_trapezoid(*double(1.3, 0.7))])
def test_moments_of_the_standard_normal(rule) -> None:
    for power, moment in enumerate([1, 0, 1, 0, 3, 0, 15, 0, 105]):
        assert float((rule.weights * rule.nodes**power).sum()) == pytest.approx(moment, abs=1e-9)


def test_gauss_hermite_is_scipys() -> None:
    nodes, weights = roots_hermitenorm(31)
    rule = gauss_hermite(31)
    np.testing.assert_allclose(rule.nodes.numpy(), nodes, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rule.weights.numpy(), weights / math.sqrt(2 * math.pi), rtol=1e-10, atol=1e-20)


@pytest.mark.parametrize("log_scale", [-10.0, -2.0, 0.0, 1.0])
def test_a_hundred_trapezoids_reach_machine_precision(log_scale: float) -> None:
    """Fact: ±8.5σ and ~100 nodes suffice for every log σ ≤ 1 and |μ| ≤ 15."""
    scale = math.exp(log_scale)
    loc = torch.tensor(LOCS, dtype=torch.float64)
    approximate = expectation(torch.sigmoid, loc, torch.full_like(loc, scale), trapezoid())
    exact = [exact_mean(m, scale) for m in LOCS]
    np.testing.assert_allclose(approximate.numpy(), exact, rtol=0, atol=1e-14)


def worst_error(rule, scale: float) -> float:
    loc = torch.linspace(-4, 4, 17, dtype=torch.float64)
    sigma = torch.full_like(loc, scale)
    reference = expectation(torch.sigmoid, loc, sigma, trapezoid(2001, 10.0))
    return float((expectation(torch.sigmoid, loc, sigma, rule) - reference).abs().max())


def test_gauss_hermite_is_fast_for_narrow_and_slow_for_wide_normals() -> None:
    """Fact: at equal numbers of nodes Gauss-Hermite wins at σ ≤ 1 with few nodes and loses badly at σ = e."""
    assert worst_error(gauss_hermite(30), 0.5) < 1e-13
    assert worst_error(gauss_hermite(60), 1.0) < 1e-11
    assert worst_error(gauss_hermite(60), math.e) > 1e-8
    assert worst_error(gauss_hermite(100), math.e) > 1e-11
    assert worst_error(trapezoid(100), math.e) < 1e-14


def test_the_trapezoid_rule_converges_geometrically() -> None:
    """Fact: error ~ exp(−2πd/h) with d = π/σ the distance to the sigmoid's pole: straight on a log scale."""
    scale, half_width = math.e, 10.0
    nodes = np.array([21, 31, 41, 51])
    errors = [worst_error(trapezoid(int(n), half_width), scale) for n in nodes]
    slope = np.polyfit(nodes - 1, np.log(errors), 1)[0]
    assert slope == pytest.approx(-2 * math.pi * (math.pi / scale) / (2 * half_width), rel=0.1)


def functionals(loc: Tensor, scale: Tensor, rule) -> Tensor:
    """Mean, second moment and softplus, with their first and second derivatives: [21, ...]."""
    out = []
    for function in (torch.sigmoid, lambda z: torch.sigmoid(z).square(), lambda z: -logsigmoid(-z)):
        value = expectation(function, loc, scale, rule)
        out.append(value.detach())
        for first in torch.autograd.grad(value.sum(), (loc, scale), create_graph=True):
            out.append(first.detach())
            out += torch.autograd.grad(first.sum(), (loc, scale), retain_graph=True)
    return torch.stack([t.detach() for t in out])


@pytest.mark.parametrize(
    ("log_scales", "tolerance"), [((-10.0, -4.0, -1.0, 0.0, 1.0), 1e-13), ((2.0, 4.0, 8.0, 12.0), 1e-8)]
)
def test_graded_trapezoid_is_right_at_every_scale(log_scales: tuple[float, ...], tolerance: float) -> None:
    """Against itself with thirty times the nodes, and against the plain rule where that is good."""
    pairs = torch.cartesian_prod(torch.tensor(LOCS), torch.tensor(log_scales)).double()
    loc, scale = pairs[:, 0].clone().requires_grad_(), pairs[:, 1].exp().requires_grad_()
    values = functionals(loc, scale, graded_trapezoid(loc, scale))
    reference = functionals(loc, scale, graded_trapezoid(loc, scale, 4001, 13.0))
    assert float(((values - reference).abs() / (1 + reference.abs())).max()) < tolerance
    if tolerance < 1e-12:
        plain = functionals(loc, scale, trapezoid(1001, 13.0))
        torch.testing.assert_close(values, plain, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("loc", "scale"), [(0.3, 30.0), (-15.0, 8.0), (100.0, 1000.0), (5.0, math.exp(-10))])
def test_graded_trapezoid_against_mpmath(loc: float, scale: float) -> None:
    mu, sigma = double(loc, scale)
    approximate = expectation(torch.sigmoid, mu, sigma, graded_trapezoid(mu, sigma))
    assert float(approximate) == pytest.approx(exact_mean(loc, scale), abs=1e-10)


def test_the_plain_rule_fails_where_the_graded_one_holds() -> None:
    """Why the graded rule exists: a hundred plain nodes cannot see the sigmoid's bend at σ = 1000."""
    loc, scale = double(100.0, 1000.0)
    truth = exact_mean(100.0, 1000.0)
    assert abs(float(expectation(torch.sigmoid, loc, scale, trapezoid())) - truth) > 1e-3


@few
@given(floats(-15, 15), floats(-10, 1))
def test_means_mirror(loc: float, log_scale: float) -> None:
    """E[sigmoid(z)] at μ and −μ add up to one."""
    mu, sigma = double(loc, math.exp(log_scale))
    total = sum(expectation(torch.sigmoid, m, sigma, graded_trapezoid(m, sigma)) for m in (mu, -mu))
    assert float(total) == pytest.approx(1.0, abs=1e-14)


def test_batched_rules_and_shared_rules_broadcast() -> None:
    loc, scale = torch.zeros(2, 3).double(), torch.ones(2, 3).double()
    assert graded_trapezoid(loc, scale).nodes.shape == (2, 3, 128)
    assert graded_trapezoid(loc.float(), scale.float()).nodes.shape == (2, 3, 48)
    assert expectation(torch.square, loc, scale, trapezoid()).shape == (2, 3)


def test_the_half_width_is_the_callers_too() -> None:
    loc, scale = double(0.0, 1.0)
    assert graded_trapezoid(loc, scale, half_width=4.0).nodes.abs().max() == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("rule", "arguments"), [(trapezoid, (1,)), (trapezoid, (10, 0.0)), (gauss_hermite, (0,))]
)
def test_impossible_rules_are_refused(rule, arguments: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="rule needs"):
        rule(*arguments)
    for number in ({"num_nodes": 1}, {"num_nodes": 0}, {"half_width": 0.0}, {"half_width": math.inf}):
        with pytest.raises(ValueError, match="trapezoid rule needs"):
            graded_trapezoid(*double(0.0, 1.0), **number)


def test_a_rule_of_whole_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match=r"floating type, and not of torch\.int64"):
        trapezoid(5, dtype=torch.int64)
    with pytest.raises(ValueError, match=r"floating type, and not of torch\.int64"):
        graded_trapezoid(torch.tensor(0), torch.tensor(1))


def test_gauss_hermite_has_as_many_nodes_as_its_weights_survive() -> None:
    assert gauss_hermite(370).weights.sum().item() == pytest.approx(1, abs=1e-9)
    for count, fix in ((0, "from 1 to 370, got 0$"), (371, "got 371: take the trapezoid rule")):
        with pytest.raises(ValueError, match=fix):
            gauss_hermite(count)


def test_types_are_promoted() -> None:
    """A location in single precision does not make the nodes coarse."""
    loc, scale = torch.tensor(1.0), torch.tensor(2.0, dtype=torch.float64)
    mixed = expectation(torch.sigmoid, loc.double(), scale, graded_trapezoid(loc, scale))
    pure = expectation(torch.sigmoid, loc.double(), scale, graded_trapezoid(loc.double(), scale))
    assert abs(mixed - pure) < 1e-15
