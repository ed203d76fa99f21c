import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta
from inbounds.learning import FAMILIES, Parameters, Policy, PolicyConfig, executed_std
from inbounds.learning.families import BetaParameters, NormalParameters, head_bias
from tests.learning.small import FAMILIES as NAMES

LOW, HIGH = np.array([-2.0, 0.5]), np.array([1.0, 4.5])


def policy(family: str) -> Policy:
    return Policy(PolicyConfig(family), LOW, HIGH)


def parameters(family: str, spread: float = -0.3) -> Parameters:
    first = torch.tensor([[0.4, -1.2], [0.0, 0.7]], dtype=torch.float64)
    if family == "beta":
        return BetaParameters(2 + first.abs(), 1.5 + first.square())
    return NormalParameters(first, torch.full_like(first, spread))


def action_law(family: str, p: Parameters) -> LogitNormal | ScaledBeta | ClippedNormal:
    kind = {"logit-normal": LogitNormal, "beta": ScaledBeta}.get(family, ClippedNormal)
    first, second = p
    return kind(first, second if family == "beta" else second.exp(), -1.0, 1.0)


def test_gaussian_and_logit_normal_share_one_law() -> None:
    assert FAMILIES["gaussian"].law is FAMILIES["logit-normal"].law


@pytest.mark.parametrize("family", NAMES)
def test_the_map_takes_the_latents_range_to_the_box(family: str) -> None:
    ends = np.array([[0.0] * 2, [0.5] * 2, [1.0] * 2]) if family == "beta" else None
    if ends is None:
        far = 1.0 if family == "gaussian" else 40.0
        ends = np.array([[-far] * 2, [0.0] * 2, [far] * 2])
    action = policy(family).action(ends)
    assert np.allclose(action, np.stack([LOW, (LOW + HIGH) / 2, HIGH]))
    assert (np.diff(policy(family).action(np.linspace(ends[0], ends[2], 9)), axis=0) >= 0).all()


def test_the_maps_are_those_of_the_public_distributions() -> None:
    latent = torch.linspace(-4, 4, 9, dtype=torch.float64)
    for family in ("logit-normal", "clipped-gaussian"):
        law = action_law(family, NormalParameters(torch.zeros(9).double(), torch.zeros(9).double()))
        unit = FAMILIES[family].to_unit(latent, torch)
        assert torch.allclose(unit, law.latent_to_value(latent), atol=1e-12)


@pytest.mark.parametrize("family", NAMES)
def test_a_box_far_from_zero_keeps_its_digits(family: str) -> None:
    """Single precision has sixteen steps in a box of width one at a million; a double's box is used in doubles."""
    low = np.array([1e6])
    latent = np.linspace(0.1, 0.9, 50, dtype=np.float32)[:, None]
    far, near = (Policy(PolicyConfig(family), at, at + 1) for at in (low, np.zeros(1)))
    assert np.allclose(far.execute(latent) - low, near.execute(latent), rtol=0, atol=1e-6)
    assert Policy(PolicyConfig(family), np.float32([0]), np.float32([1])).action(latent).dtype == np.float32


def test_only_the_gaussian_leaves_the_box() -> None:
    far = np.array([[3.0, -3.0]])
    assert (policy("gaussian").action(far) > HIGH).any()
    for family in ("clipped-gaussian", "logit-normal"):
        action = policy(family).action(far)
        assert (action >= LOW).all()
        assert (action <= HIGH).all()


@pytest.mark.parametrize("family", NAMES)
def test_greedy_actions_are_those_of_the_law_over_actions(family: str) -> None:
    rows = torch.tensor([[0.4, -0.2, 0.1, -0.6]], dtype=torch.float64)  # outputs of two action dimensions
    bound = policy(family)
    law = action_law(family, bound.parameters(rows))
    assert set(bound.family.greedy) == {"mean", "median", "mode"}
    for by in bound.family.greedy:
        if family == "beta" and by == "median":  # torch has none: SciPy's, on the unit interval
            centre = 2 * stats.beta.median(law.concentration1, law.concentration0) - 1
        else:
            centre = (law.median if family == "gaussian" else getattr(law, by)).numpy()
        expected = bound.centre + bound.half_range * centre
        assert np.allclose(bound.greedy(rows, by), expected, atol=1e-12)


@pytest.mark.parametrize("family", NAMES)
def test_the_distribution_has_the_density_of_the_mapped_latent(family: str) -> None:
    rows = torch.tensor([[0.4, -0.2, 0.1, -0.6]], dtype=torch.float64)
    bound = policy(family)
    latent = torch.tensor([[0.3, 0.8], [0.51, 0.25]], dtype=torch.float64)  # inside, for every family
    action, step = bound.action(latent.numpy()), 1e-6
    slope = (bound.action(latent.numpy() + step) - bound.action(latent.numpy() - step)) / (2 * step)
    expected = bound.law.log_prob(bound.parameters(rows), latent).numpy() - np.log(slope).sum(-1)
    density = bound.distribution(rows).log_prob(torch.from_numpy(action)).sum(-1)
    assert density.shape == (2,)
    assert np.allclose(density, expected, atol=1e-8)


def test_the_clipped_gaussians_distribution_has_its_mass_on_the_bounds() -> None:
    rows = torch.tensor([[0.4, -0.2, 0.1, -0.6]], dtype=torch.float64)
    bound = policy("clipped-gaussian")
    beyond = torch.tensor([[1.5, -2.0]], dtype=torch.float64)
    on_bounds = torch.tensor([[HIGH[0], LOW[1]]])
    mass = bound.distribution(rows).log_prob(on_bounds).sum(-1)
    assert torch.allclose(mass, bound.law.log_prob(bound.parameters(rows), beyond), atol=1e-9)


def test_what_is_executed_is_in_the_box_in_its_precision_and_a_diverged_policy_holds_still() -> None:
    bound = Policy(PolicyConfig("gaussian"), LOW.astype(np.float32), HIGH.astype(np.float32))
    latent = np.array([[3.0, 0.5], [np.nan, -3.0]])
    clipped, raw = bound.execute(latent), bound.execute(latent, "raw")
    assert clipped.dtype == raw.dtype == np.float32
    assert clipped.tolist() == [[1.0, 3.5], [-0.5, 0.5]]
    assert raw.tolist() == [[4.0, 3.5], [-0.5, -3.5]]
    outputs = np.full((2, 4), np.nan)
    streams = [np.random.default_rng(s) for s in (0, 1)]
    assert bound.sample(outputs, streams).tolist() == [[-0.5, 2.5]] * 2
    with pytest.raises(ValueError, match="2 rows of outputs need a generator each, not 1"):
        bound.sample(outputs, streams[:1])
    assert bound.greedy(torch.from_numpy(outputs), "mean").tolist() == [[-0.5, 2.5]] * 2


def test_an_unknown_greedy_action_is_refused_with_the_choices() -> None:
    with pytest.raises(ValueError, match="beta offers the greedy actions mean, median, mode, not 'best'"):
        policy("beta").greedy(torch.zeros(4), "best")


@pytest.mark.parametrize("family", NAMES)
@pytest.mark.parametrize("spread", [-2.0, 0.0, 1.0])
def test_entropy_and_its_gradient_are_those_of_the_named_law(family: str, spread: float) -> None:
    p = parameters(family, spread)
    leaves = [x.clone().requires_grad_() for x in p]
    ours = FAMILIES[family].entropy(type(p)(*leaves))
    assert ours.shape == (2,)
    same = [x.clone().requires_grad_() for x in p]
    if family == "gaussian":
        theirs = torch.distributions.Normal(same[0], same[1].exp()).entropy().sum(-1)
    else:
        theirs = action_law(family, type(p)(*same)).entropy().sum(-1)
    tolerance = 1e-3 if family == "logit-normal" else 1e-9
    assert torch.allclose(ours, theirs, atol=tolerance, rtol=0)
    ours_gradients = torch.autograd.grad(ours.sum(), leaves, allow_unused=True)
    their_gradients = torch.autograd.grad(theirs.sum(), same, allow_unused=True)
    for a, b in zip(ours_gradients, their_gradients, strict=True):
        zero = torch.zeros_like(leaves[0])
        assert torch.allclose(zero if a is None else a, zero if b is None else b, atol=2 * tolerance, rtol=0)


@settings(deadline=None, max_examples=15)
@given(st.sampled_from(NAMES), st.floats(0.12, 0.55))
def test_initial_std_is_the_executed_standard_deviation(family: str, std: float) -> None:
    """By sampling: draw, map, clip, and measure in units of half the range."""
    bias = head_bias(PolicyConfig(family, initial_std=std))
    assert bias is not None
    bound = policy(family)
    outputs = np.repeat(np.array(bias), 2)[None]  # [1, 2A]
    draw = bound.law.sampler([np.random.default_rng(0)], 4000, 2, np.float64)
    p = bound.parameters(outputs, np)
    action = np.stack([draw(p, t)[0] for t in range(4000)])
    executed = np.clip(bound.action(action), LOW, HIGH)
    measured = np.sqrt((((executed - bound.centre) / bound.half_range) ** 2).mean())
    assert measured == pytest.approx(std, rel=0.05)


@pytest.mark.parametrize("scale", [1e17, 1e155, 1.7e308])
@pytest.mark.parametrize("family", ["gaussian", "clipped-gaussian", "logit-normal"])
def test_the_widest_laws_are_on_the_bounds(family: str, scale: float) -> None:
    assert executed_std(family, scale) == 1


def test_executed_std_is_that_of_the_public_distributions() -> None:
    for s in (0.05, 0.5, 2.0):
        assert executed_std("gaussian", s) == pytest.approx(ClippedNormal(0.0, s).stddev.item(), rel=1e-5)
        law = LogitNormal(torch.zeros(()).double(), s, -1.0, 1.0)
        assert executed_std("logit-normal", s) == pytest.approx(law.stddev.item(), rel=1e-9)
        assert executed_std("beta", 1 + s) == pytest.approx(
            ScaledBeta(1 + s, 1 + s, -1.0, 1.0).stddev.item(), rel=1e-5
        )


@pytest.mark.parametrize("scale", [0.3, math.e, 2.72, 12.0, 300.0])
def test_the_executed_std_of_a_logit_normal_is_an_integral(scale: float) -> None:
    def lost(u: float) -> float:  # of a sign's variance, where z = 2u
        return 2 * stats.norm.pdf(2 * u, scale=scale) / np.cosh(u) ** 2

    integral, _ = integrate.quad(lost, -40, 40, epsabs=1e-13, limit=500, points=[0])
    assert executed_std("logit-normal", scale) == pytest.approx(math.sqrt(1 - integral), rel=1e-9)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (lambda: PolicyConfig("normal"), "no policy family 'normal'; choose one of gaussian"),
        (lambda: executed_std("cauchy", 1.0), "no policy family 'cauchy'; choose one of gaussian"),
        (lambda: PolicyConfig(["beta"]), r"no policy family \['beta'\]; choose one of gaussian"),
        (lambda: executed_std("gaussian", math.inf), "a scale must be positive and finite, got inf"),
        (lambda: executed_std("gaussian", math.nan), "a scale must be positive and finite, got nan"),
        (lambda: PolicyConfig("beta", state_dependent_std=False), "no scale"),
        (lambda: head_bias(PolicyConfig("beta", initial_std=0.7)), "between 0.07"),
        (lambda: head_bias(PolicyConfig("gaussian", initial_std=1.2)), "out of reach"),
        (lambda: Policy(PolicyConfig("beta"), LOW, np.array([np.inf, 1.0])), "bounds must be finite"),
        (lambda: Policy(PolicyConfig("beta"), HIGH, LOW), "low must be less than high.*Swap the bounds"),
        (lambda: Policy(PolicyConfig("beta"), [-1.7e308], [1.7e308]), "length overflows"),
        (
            lambda: Policy(PolicyConfig("beta"), *np.float32([[1e8], [1e8 + 8]])),
            "Use float64, or move the interval",
        ),
        (lambda: Policy(PolicyConfig("beta"), np.zeros(0), np.zeros(0)), "A at least 1"),
        (lambda: Policy(PolicyConfig("beta"), LOW[None], HIGH[None]), "one-dimensional Box"),
    ],
)
def test_bad_input_gets_an_error_that_names_the_fix(config, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        config()
