"""What every law of the package promises, whatever its density."""

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
import scipy.stats
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.distributions import Independent, kl_divergence

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta
from inbounds.distributions.open_interval import OpenInterval

from .families import FAMILIES, Family, double, few, floats, intervals

pytestmark = pytest.mark.filterwarnings("ignore:There is a performance drop")  # torch.vmap over log_ndtr

shapes = st.lists(st.integers(1, 3), max_size=3).map(tuple)


@pytest.fixture(params=FAMILIES.values(), ids=FAMILIES.keys())
def family(request: pytest.FixtureRequest) -> Family:
    return request.param


each_family = st.sampled_from(list(FAMILIES.values()))
STATISTICS = ("mean", "variance", "stddev", "mode")


@few
@given(each_family, shapes, shapes)
def test_shapes(family: Family, batch: tuple[int, ...], sample: tuple[int, ...]) -> None:
    law = family.make(batch)
    assert law.batch_shape == batch
    assert law.event_shape == ()
    value = law.rsample(sample)
    assert value.shape == (*sample, *batch)
    assert law.log_prob(value).shape == (*sample, *batch)
    assert law.log_prob_latent(law.rsample_latent(sample)).shape == (*sample, *batch)
    assert law.entropy().shape == batch
    assert kl_divergence(law, family.make(batch, seed=1)).shape == batch
    for name in STATISTICS:
        assert getattr(law, name).shape == batch, name


def test_bounds_broadcast_with_the_parameters(family: Family) -> None:
    first, second = family.parameters()
    low, high = np.array([-1.0, -2.0, 0.0], np.float32), np.array([1.0, 5.0, 0.5], np.float32)
    law = family.law(first, second, low, high)  # as a Gymnasium Box gives them
    assert law.batch_shape == (3,)
    assert law.mean.dtype == torch.float64
    for i in range(3):
        alone = family.law(first, second, float(low[i]), float(high[i]))
        torch.testing.assert_close(law.mean[i], alone.mean)
        torch.testing.assert_close(law.entropy()[i], alone.entropy())


@few
@given(each_family, shapes)
def test_expand_is_the_same_law(family: Family, batch: tuple[int, ...]) -> None:
    law = family.make(batch)
    wide = law.expand((2, *batch))
    assert type(wide) is type(law)
    assert wide.batch_shape == (2, *batch)
    value = law.sample()
    torch.testing.assert_close(wide.log_prob(value), law.log_prob(value).expand(2, *batch))
    torch.testing.assert_close(wide.mean, law.mean.expand(2, *batch))
    assert wide.sample().shape == (2, *batch)
    assert wide._validate_args == law._validate_args


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda law: pickle.loads(pickle.dumps(law))])
def test_copies_are_the_same_law(family: Family, duplicate: Any) -> None:
    law = family.make((3,))
    twin = duplicate(law)
    value = law.sample((5,))
    assert torch.equal(twin.log_prob(value), law.log_prob(value))
    assert torch.equal(kl_divergence(law, twin), torch.zeros(3, dtype=torch.float64))


def test_independent_sums_over_the_event(family: Family) -> None:
    law = family.make((4, 3))
    joint, other = Independent(law, 1), Independent(family.make((4, 3), seed=1), 1)
    assert (joint.batch_shape, joint.event_shape) == ((4,), (3,))
    value = joint.rsample((2,))
    torch.testing.assert_close(joint.log_prob(value), law.log_prob(value).sum(-1))
    torch.testing.assert_close(joint.entropy(), law.entropy().sum(-1))
    torch.testing.assert_close(kl_divergence(joint, other), kl_divergence(law, other.base_dist).sum(-1))
    torch.testing.assert_close(joint.mode, law.mode)
    assert joint.expand((2, 4)).sample().shape == (2, 4, 3)


@pytest.mark.parametrize(
    "quantity",
    [
        lambda law: law.log_prob(torch.tensor(0.7, dtype=torch.float64)),
        lambda law: law.log_prob_latent(torch.tensor(0.7, dtype=torch.float64)),
        lambda law: law.mean,
        lambda law: law.variance,
        lambda law: law.mode,
        lambda law: law.entropy(),
        lambda law: kl_divergence(law, law.expand(law.batch_shape)),
    ],
)
def test_vmap_equals_the_loop(family: Family, quantity: Any) -> None:
    first, second = family.parameters((5,))
    mapped = torch.vmap(lambda a, b: quantity(family.law(a, b, -1.0, 2.0)))(first, second)
    looped = torch.stack([quantity(family.law(a, b, -1.0, 2.0)) for a, b in zip(first, second, strict=True)])
    torch.testing.assert_close(mapped, looped, rtol=1e-12, atol=1e-14)


def test_vmap_of_samples(family: Family) -> None:
    first, second = family.parameters((5,))
    sample = torch.vmap(lambda a, b: family.law(a, b, -1.0, 2.0).rsample((3,)), randomness="different")
    value = sample(first, second)
    assert value.shape == (5, 3)
    assert bool(((value >= -1) & (value <= 2)).all())


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_samples_follow_the_law(family: Family, seed: int) -> None:
    """Kolmogorov-Smirnov against SciPy; on the atoms of a mixed law the test is conservative."""
    law = family.make(low=-0.5, high=1.5, seed=seed)
    value = law.sample((4000,), generator=torch.Generator().manual_seed(seed)).numpy()
    parameters = [float(getattr(law, name)) for name in (*family.names, "low", "high")]
    inside = np.sort(value[(value > -0.5) & (value < 1.5)])
    masses = family.cdf(np.array([-0.5, 1.5 - 1e-12]), *parameters)  # P(a ≤ low), P(a < high)
    conditional = (family.cdf(inside, *parameters) - masses[0]) / (masses[1] - masses[0])
    assert scipy.stats.kstest(conditional, "uniform").pvalue > 1e-3
    on_low = (value == -0.5).sum()
    assert scipy.stats.binomtest(int(on_low), 4000, float(masses[0])).pvalue > 1e-3


def test_a_generator_decides_the_sample(family: Family) -> None:
    law = family.make((3,))
    torch.manual_seed(0)
    draws = [law.rsample((4,), generator=torch.Generator().manual_seed(7)) for _ in range(2)]
    assert torch.equal(*draws)
    state = torch.get_rng_state()
    law.sample((4,), generator=torch.Generator().manual_seed(7))
    assert torch.equal(state, torch.get_rng_state())  # the global generator was left alone


def test_sample_is_cut_off_and_rsample_is_not(family: Family) -> None:
    first, second = (p.requires_grad_() for p in family.parameters((3,)))
    law = family.law(first, second)
    assert law.has_rsample
    assert not law.sample().requires_grad
    gradients = torch.autograd.grad(law.rsample((500,)).mean(0).sum(), (first, second))
    assert all(bool((g != 0).all()) for g in gradients)


def test_pathwise_gradient_of_the_mean(family: Family) -> None:
    """E of d(sample)/dθ is d(mean)/dθ, within four standard errors."""
    first, second = (p.requires_grad_() for p in family.parameters(seed=3))
    law = family.law(first, second, -1.0, 2.0)
    exact = torch.autograd.grad(law.mean, (first, second))
    n = 4000
    copies = [p.detach().expand(n).clone().requires_grad_() for p in (first, second)]
    value = family.law(*copies, -1.0, 2.0).rsample(generator=torch.Generator().manual_seed(0))
    for g, e in zip(torch.autograd.grad(value.sum(), copies), exact, strict=True):
        assert abs(g.mean() - e) < 4 * g.std() / n**0.5


@few
@given(each_family, intervals(), st.integers(0, 100))
def test_bounds_only_move_and_stretch(family: Family, bounds: tuple[float, float], seed: int) -> None:
    """With parameters moved along, mean and mode move with the interval, and densities shrink by its length."""
    low, high = bounds
    width = high - low
    first, second = family.parameters(seed=seed)
    unit = family.law(first, second, 0.0, 1.0)
    if family.law is ClippedNormal:
        first, second = low + width * first, width * second
    law = family.law(first, second, low, high)
    torch.testing.assert_close(law.mean, low + width * unit.mean, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(law.mode, low + width * unit.mode, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(law.stddev, width * unit.stddev, rtol=1e-9, atol=1e-12)
    fraction = torch.tensor(0.3, dtype=torch.float64)
    density = unit.log_prob(fraction) - np.log(width)
    torch.testing.assert_close(law.log_prob(low + width * fraction), density, rtol=1e-9, atol=1e-9)


@few
@given(each_family, st.integers(0, 1000))
def test_kl_is_positive_and_zero_only_at_home(family: Family, seed: int) -> None:
    p, q = family.make((6,), seed=seed), family.make((6,), seed=seed + 1)
    assert bool((kl_divergence(p, q) > 0).all())
    torch.testing.assert_close(kl_divergence(p, p), torch.zeros(6, dtype=torch.float64), rtol=0, atol=1e-13)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 2.5), (-1.5, 2.0)])
def test_kl_needs_equal_bounds(family: Family, low: float, high: float) -> None:
    with pytest.raises(ValueError, match="equal bounds"):
        kl_divergence(family.make(), family.make(low=low, high=high))


def test_unequal_bounds_among_many_are_named_once(family: Family) -> None:
    high = torch.full((500, 6), 2.0, dtype=torch.float64)
    other = high.clone()
    other[3, 4] = 2.5
    with pytest.raises(
        ValueError, match=r"p has low=-1\.0, high=2\.0 and q has low=-1\.0, high=2\.5\."
    ) as caught:
        kl_divergence(family.make(low=-1.0, high=high), family.make(low=-1.0, high=other))
    assert len(str(caught.value)) < 200


def test_double_derivatives_agree_with_differences(family: Family) -> None:
    """gradcheck and gradgradcheck of all that is differentiable in the parameters, at several of them."""

    def quantities(first: torch.Tensor, second: torch.Tensor) -> tuple[torch.Tensor, ...]:
        law = family.law(first, second, -1.0, 2.0, validate_args=False)
        other = family.law(second, second, -1.0, 2.0, validate_args=False)  # any law that depends on both
        value = torch.tensor([[-0.5], [1.99]], dtype=torch.float64)
        return (
            law.log_prob(value),
            law.log_prob_latent(value),
            law.mean,
            law.variance,
            law.entropy(),
            kl_divergence(law, other),
            kl_divergence(other, law),
        )

    inputs = tuple(p.requires_grad_() for p in family.parameters((2,), seed=5))
    assert torch.autograd.gradcheck(quantities, inputs)
    assert torch.autograd.gradgradcheck(quantities, inputs)


@few
@given(each_family, floats(-4, 4), floats(-3, 1.0))
def test_float32_agrees_with_float64(family: Family, first: float, log_second: float) -> None:
    second = float(np.exp(log_second))
    if family.law is ScaledBeta:
        first = float(np.exp(first))
    exact = family.law(*double(first, second), -1.0, 2.0)
    short = family.law(torch.tensor(first), torch.tensor(second), -1.0, 2.0)
    for name in ("mean", "variance", "mode"):
        value = getattr(short, name)
        assert value.dtype == torch.float32
        torch.testing.assert_close(value.double(), getattr(exact, name), rtol=2e-4, atol=2e-6)
    assert short.entropy().dtype == torch.float32
    torch.testing.assert_close(short.entropy().double(), exact.entropy(), rtol=1e-5, atol=1e-5)
    probe = torch.tensor([-0.75, 0.125, 1.5])
    assert short.log_prob(probe).dtype == torch.float32
    torch.testing.assert_close(
        short.log_prob(probe).double(), exact.log_prob(probe.double()), rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize("bad", [-1.5, 2.5, float("nan")])
def test_a_value_beyond_the_bounds(family: Family, bad: float) -> None:
    law = family.make()
    value = torch.tensor(bad, dtype=torch.float64)
    with pytest.raises(ValueError, match="1 of 1 values lie outside the support, the first"):
        law.log_prob(value)
    with pytest.raises(ValueError, match=r"^Values lie outside the support\. Keep the latent"):
        torch.vmap(law.log_prob)(value.expand(2, 3))
    lax = family.law(*family.parameters(), -1.0, 2.0, validate_args=False)
    log_prob = lax.log_prob(value)
    assert bool(log_prob.isnan()) if np.isnan(bad) else log_prob == -torch.inf


def test_a_gradient_survives_a_value_beyond_the_bounds(family: Family) -> None:
    """In a batch, one value outside must not turn the others' gradients into NaN."""
    first, second = (p.requires_grad_() for p in family.parameters())
    law = family.law(first, second, -1.0, 2.0, validate_args=False)
    value = torch.tensor([-7.0, 0.5, 2.0, 9.0, torch.inf], dtype=torch.float64, requires_grad=True)
    log_prob = law.log_prob(value)
    gradients = torch.autograd.grad(log_prob[1], (first, second, value))
    assert all(bool(g.isfinite().all()) for g in gradients)
    outside = torch.autograd.grad(law.log_prob(value)[[0, 3, 4]].sum(), (first, second, value))
    assert all(bool((g == 0).all()) for g in outside)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"low": 3.0}, "low must be less than high"),
        ({"low": 2.0}, "low must be less than high"),
        ({"low": -torch.inf}, "must be finite"),
        ({"high": torch.nan}, "must be finite"),
        ({"low": -1.5e308, "high": 1.5e308}, "length overflows"),
        ({"low": 1e16, "high": 1e16 + 2}, "no torch.float64 number lies strictly between"),
        ({"low": torch.zeros(2), "high": torch.tensor([1.0, 0.0])}, r"low=0.0, high=0.0 at index \(1,\)"),
    ],
)
def test_bad_bounds_are_refused(family: Family, change: dict[str, Any], message: str) -> None:
    first, second = family.parameters()
    bounds = {"low": -1.0, "high": 2.0} | change
    with pytest.raises(ValueError, match=message):
        family.law(first, second, **bounds)
    family.law(first, second, **bounds, validate_args=False)  # the reader's own risk


@pytest.mark.parametrize("which", [0, 1])
def test_bad_parameters_are_refused(family: Family, which: int) -> None:
    name = family.names[which]
    for bad in [float("nan")] if name == "loc" else [float("nan"), 0.0, -1.0]:
        parameters = [p.clone() for p in family.parameters((3,))]
        parameters[which][1] = bad
        with pytest.raises(ValueError, match=f"parameter {name}"):
            family.law(*parameters)
    for infinite in [torch.inf, -torch.inf] if name == "loc" else [torch.inf]:
        parameters = [p.clone() for p in family.parameters((3,))]
        parameters[which][1] = infinite
        with pytest.raises(ValueError, match=f"{name} must be finite.*clip what feeds it"):
            family.law(*parameters)
        family.law(*parameters, validate_args=False)  # the reader's own risk


def test_shapes_that_do_not_broadcast_are_named(family: Family) -> None:
    with pytest.raises(ValueError, match=rf"{family.names[0]} \[3\], {family.names[1]} \[2\]"):
        family.law(torch.ones(3), torch.ones(2))


def test_integers_become_the_default_float(family: Family) -> None:
    law = family.law(torch.tensor(1), 2, -1, 2)
    assert law.mean.dtype == torch.get_default_dtype()


def test_a_read_only_bound_is_taken(family: Family) -> None:
    low = np.array([-1.0, -1.0])
    low.flags.writeable = False
    assert family.make((2,), low=low).batch_shape == (2,)


@pytest.mark.parametrize("law", [LogitNormal, ScaledBeta])
def test_support_is_open(law: Any) -> None:
    support = law(1.0, 1.0, -1.0, 2.0).support
    assert support.check(torch.tensor([-1.0, -0.999, 1.999, 2.0])).tolist() == [False, True, True, False]
    assert "OpenInterval" in repr(support)
    assert pickle.loads(pickle.dumps(support)).check(torch.tensor(0.0))


def test_support_of_the_clipped_normal_is_closed() -> None:
    support = ClippedNormal(0.0, 1.0, -1.0, 2.0).support
    assert support.check(torch.tensor([-1.001, -1.0, 2.0, 2.001])).tolist() == [False, True, True, False]


@few
@given(
    st.sampled_from([LogitNormal, ScaledBeta]),
    intervals(),
    st.sampled_from([torch.float32, torch.float64]),
)
def test_no_latent_maps_onto_a_bound(law: Any, bounds: tuple[float, float], dtype: torch.dtype) -> None:
    latent = torch.tensor(
        [-torch.inf, -1000.0, -100.0, -40.0, 0.0, 17.0, 40.0, 1000.0, torch.inf], dtype=dtype
    )
    first = torch.ones(9, dtype=dtype, requires_grad=True)
    distribution = law(first, 1.0, *bounds)
    value = distribution.latent_to_value(latent)
    assert value.dtype == dtype
    assert bool(distribution.support.check(value).all())
    assert bool((value.diff() >= 0).all())
    log_prob = distribution.log_prob(value)  # does not raise
    assert bool(log_prob.isfinite().all())
    assert bool(torch.autograd.grad(log_prob.sum(), first)[0].isfinite().all())


@few
@given(st.sampled_from([LogitNormal, ScaledBeta]), intervals(), floats(-12, 12))
def test_latent_and_value_invert_each_other(law: Any, bounds: tuple[float, float], latent: float) -> None:
    distribution = law(*double(1.0, 1.0), *bounds)
    (z,) = double(latent)
    back = distribution.value_to_latent(distribution.latent_to_value(z))
    torch.testing.assert_close(back, z, rtol=0, atol=1e-8)


def test_next_to_a_bound_at_zero_nothing_is_lost() -> None:
    """Where the bound is zero the value resolves what lies next to it, on either side."""
    latent = torch.tensor([60.0], dtype=torch.float64)
    for low, high, z in ((0.0, 1.0, -latent), (-1.0, 0.0, latent)):
        distribution = LogitNormal(*double(0.0, 1.0), low, high)
        back = distribution.value_to_latent(distribution.latent_to_value(z))
        torch.testing.assert_close(back, z, rtol=1e-14, atol=0)


def test_the_standard_deviation_of_what_is_no_law_is_nan(family: Family) -> None:
    first, second = family.parameters()
    assert family.law(first * math.nan, second * math.nan, -1.0, 1.0, validate_args=False).stddev.isnan()


@pytest.mark.parametrize("law", [ClippedNormal, LogitNormal])
def test_the_standard_deviation_has_a_gradient_where_it_underflows(law: Any) -> None:
    loc = torch.tensor([1000.0, 0.5], dtype=torch.float64, requires_grad=True)
    stddev = law(loc, 0.5, -1.0, 1.0).stddev
    assert stddev[0] == 0
    (gradient,) = torch.autograd.grad(stddev.sum(), loc)
    below, above = law(*double([0.5 - 1e-5, 0.5 + 1e-5], 0.5), -1.0, 1.0).stddev
    assert gradient.tolist() == pytest.approx([0.0, float(above - below) / 2e-5], rel=1e-7)


@pytest.mark.parametrize("law", [LogitNormal, ClippedNormal])
def test_the_ends_of_the_quantile_function_do_not_spoil_gradients(law: Any) -> None:
    loc, scale = (torch.tensor(x, dtype=torch.float64, requires_grad=True) for x in (0.1, 0.5))
    p = torch.tensor([0.0, 0.3, 1.0], dtype=torch.float64, requires_grad=True)
    quantiles = law(loc, scale, -1.0, 1.0).icdf(p)
    assert torch.allclose(quantiles[::2].abs(), torch.ones(2, dtype=torch.float64))
    all_three = torch.autograd.grad(quantiles.sum(), (loc, scale), retain_graph=True)
    alone = torch.autograd.grad(quantiles[1], (loc, scale), retain_graph=True)
    assert all_three == alone
    assert torch.isfinite(torch.autograd.grad(quantiles.sum(), p)[0]).all()
    assert law(0.0, 1.0, -1.0, 1.0).icdf(torch.tensor([-0.1, 1.1])).isnan().all()


@pytest.mark.parametrize("registry", [torch.distributions.biject_to, torch.distributions.transform_to])
def test_torch_knows_a_map_onto_the_open_interval(registry: Any) -> None:
    law = LogitNormal(torch.zeros(2), torch.ones(2), torch.tensor([-1.0, 0.0]), torch.tensor([1.0, 5.0]))
    to_box = registry(law.support)
    x = torch.tensor([[-3.0, 0.5]])
    assert torch.allclose(to_box(x), law.latent_to_value(x))
    assert torch.allclose(to_box.inv(to_box(x)), x, atol=1e-5)
    (slope,) = torch.autograd.grad(to_box(x.requires_grad_()).sum(), x)
    assert torch.allclose(to_box.log_abs_det_jacobian(x, to_box(x)), slope.log(), atol=1e-5)
    far = torch.tensor([[-200.0, 200.0], [200.0, -200.0], [-torch.inf, torch.inf]])
    assert law.support.check(to_box(far)).all()  # the closed interval's map rounds onto the bounds
    assert to_box == registry(law.support) != registry(LogitNormal(0.0, 1.0, -1.0, 1.0).support)
    again = to_box.with_cache()
    assert again == to_box
    assert again(x) is again(x)  # kept
    both = torch.distributions.ComposeTransform([registry(OpenInterval(0.0, 1.0))], cache_size=1)
    assert both.inv(both(x)) is x


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_map_onto_bounds_that_are_numbers_has_those_bounds_in_any_precision(dtype: torch.dtype) -> None:
    interval = OpenInterval(0.3, 0.7)
    to_box = torch.distributions.biject_to(interval)
    ends = to_box(torch.tensor([-torch.inf, torch.inf], dtype=dtype))
    assert ends.dtype == dtype
    assert interval.check(ends).all()
    inside = torch.nextafter(torch.tensor(0.3, dtype=dtype), torch.tensor(1.0, dtype=dtype))
    assert interval.check(inside)
    assert not to_box.inv(inside).isnan()
    assert to_box == torch.distributions.biject_to(OpenInterval(0.3, 0.7))


def test_next_to_a_bound_at_zero_the_score_is_a_number() -> None:
    law = LogitNormal(0.0, 1.0, 0.0, 1.0)
    value = law.latent_to_value(torch.tensor(-200.0)).requires_grad_()
    (slope,) = torch.autograd.grad(law.log_prob(value), value)
    assert value.item() > 0
    assert not slope.isnan()


def test_one_checked_law_is_enough_to_compare_bounds(family: Family) -> None:
    checked = family.make()
    unchecked = family.law(*family.parameters(), -1.0, 3.0, validate_args=False)
    for p, q in ((checked, unchecked), (unchecked, checked)):
        with pytest.raises(ValueError, match="equal bounds"):
            kl_divergence(p, q)


def test_a_value_in_double_precision_is_scored_in_it() -> None:
    for law in (LogitNormal(0.0, 1.0, -1.0, 1.0), ScaledBeta(2.0, 3.0, -1.0, 1.0)):
        assert law.log_prob(torch.tensor(0.3, dtype=torch.float64)).dtype == torch.float64, law


def test_bounds_of_one_box_in_two_precisions_are_equal() -> None:
    p = LogitNormal(torch.tensor(0.0), 1.0, 0.1, 0.7)
    q = LogitNormal(*(torch.tensor(x, dtype=torch.float64) for x in (0.5, 1.0, 0.1, 0.7)))
    assert torch.distributions.kl_divergence(p, q).item() == pytest.approx(0.125)


def test_bounds_that_rounding_made_equal_are_told_apart_from_swapped_ones() -> None:
    with pytest.raises(ValueError, match=r"use float64 where torch\.float32 made one"):
        ScaledBeta(2.0, 2.0, 100.0, 100.000001)
    with pytest.raises(ValueError, match="Swap the bounds"):
        ScaledBeta(2.0, 2.0, 1.0, 0.0)
