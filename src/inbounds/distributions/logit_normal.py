r"""The logit-normal: a Normal latent, squashed by a sigmoid into an interval.

With z ~ N(μ, σ²), the value is a = low + (high − low) · sigmoid(z). By change of variables its density is

$$ p(a) = N(z; μ, σ²) · |dz/da|,  z = log((a − low)/(high − a)),  dz/da = (high − low)/((a − low)(high − a)), $$

Johnson's S_B distribution (Johnson 1949; Aitchison & Shen 1980), here with location, scale and bounds. On
[−1, 1] it is the law of tanh(x) with x ~ N(μ/2, σ²/4): the squashed Gaussian of soft actor-critic (Haarnoja et
al. 2018, appendix C). KL divergence, density ratio and score are those of the latent Normals, because all three
are invariant under a bijection.

What is *not* invariant is computed here:

* median = image of μ, exactly;
* mean and variance by quadrature under the Normal (no closed form);
* mode by Newton's method on z = μ + σ² tanh(z/2), the stationary points of log p;
* entropy = ½ log(2πeσ²) + log(high − low) + E[log sigmoid(z) + log sigmoid(−z)], which is the same as
  ½ log(2πeσ²) + μ − 2 E[softplus(z)] + log(high − low) and does not cancel for large |μ|.

The law has two modes iff σ² > 2 and |μ| < σ²k − 2 artanh k with k = √(1 − 2/σ²).
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor
from torch.distributions import register_kl
from torch.distributions.kl import _kl_normal_normal
from torch.nn.functional import logsigmoid

from inbounds.distributions.bounds import NormalLatent, SigmoidMapped, TensorLike, require_equal_bounds
from inbounds.distributions.quadrature import expectation, graded_trapezoid
from inbounds.distributions.standard_normal import normal_quantile, standard_normal_cdf

__all__ = ["LogitNormal"]

_NEWTON_STEPS = 60  # quadratic, but for the cusp (μ = 0, σ² = 2), where each step only takes a third off


class LogitNormal(NormalLatent, SigmoidMapped):
    r"""Law of low + (high − low) · sigmoid(z) for z ~ Normal(loc, scale); elementwise over broadcast parameters.

    **Edges of the support.** The support is the open interval. `log_prob` and `cdf` of a value on a bound or beyond
    it raise under validation; without, `log_prob` is −inf and `cdf` is 0 or 1. A *sample* is never on a bound: where
    sigmoid(z) rounds to one, the sample is the largest floating-point number below high (likewise above low). Its
    `log_prob` is finite, but it is the density at the rounded value, which has forgotten z. What must be exact
    there (a ratio, a gradient) starts from the latent: `rsample_latent`, `log_prob_latent`.

    **Accuracy.** In float64 mean, variance and entropy, with their first and second derivatives, are right to
    1e-10 for log σ ≤ 1 and |μ| ≤ 15 (measured: 1e-12; mean and variance 1e-11 *relatively*), and to 1e-8 up to
    log σ = 12.

    Args:
        loc: `[...]` mean μ of the latent.
        scale: `[...]` standard deviation σ of the latent, positive.
        low: `[...]` lower bound, in units of the action.
        high: `[...]` upper bound.
        validate_args: check parameters and values; see `BoundedDistribution`.

    Raises:
        ValueError: parameters or bounds that make no distribution; of bounds the message names the fix.

    Example:
        >>> import torch
        >>> action = LogitNormal(torch.tensor([0.0, 1.0]), 0.5, low=-1.0, high=torch.tensor([1.0, 3.0]))
        >>> [round(x, 4) for x in action.median.tolist()]
        [0.0, 1.9242]
        >>> sample = action.sample((1000,))
        >>> sample.shape, bool(action.support.check(sample).all())
        (torch.Size([1000, 2]), True)
    """

    def __init__(
        self,
        loc: TensorLike,
        scale: TensorLike,
        low: TensorLike = 0.0,
        high: TensorLike = 1.0,
        validate_args: bool | None = None,
    ) -> None:
        super().__init__(loc=loc, scale=scale, low=low, high=high, validate_args=validate_args)

    # ---- the latent (drawn by NormalLatent; its bijection with the value: SigmoidMapped)

    def log_prob_latent(self, latent: Tensor) -> Tensor:
        """Return log p(a) in nats at a = latent_to_value(latent): the density over *values*, read off the latent.

        log N(latent; loc, scale²) + softplus(latent) + softplus(−latent) − log(width). No rounding of the value
        enters: it is exact (and so is its gradient) where the value has long saturated. Two laws with the same
        bounds differ by their Normals' log-densities: the Jacobian cancels in every ratio.

        Args:
            latent: `[...]` latents z, broadcast against the parameters.

        Returns:
            `[...]` log-density with respect to the length da, in nats.

        Example:
            >>> import torch
            >>> law = LogitNormal(0.0, 1.0)
            >>> round(law.log_prob_latent(torch.tensor(40.0)).item(), 3)  # the value is 1 − 4e-18
            -760.919
        """
        return self._normal().log_prob(latent) - _log_slope(latent) - self.width.log()

    # ---- the density over values

    def log_prob(self, value: Tensor) -> Tensor:
        """Return the log-density at value, `[...]`, in nats; −inf outside the open interval (see the class)."""
        if self._validate_args:
            self._validate_sample(value)
        above_low, below_high, outside = self._distances(value)
        latent = above_low.log() - below_high.log()
        log_jacobian = self.width.log() - above_low.log() - below_high.log()  # log dz/da
        log_density = self._normal().log_prob(latent) + log_jacobian
        return log_density.masked_fill(outside, -math.inf)

    def cdf(self, value: Tensor) -> Tensor:
        """Return P(a ≤ value) = Φ((z − loc)/scale), `[...]`."""
        if self._validate_args:
            self._validate_sample(value)
        above_low, below_high, outside = self._distances(value)
        inside = standard_normal_cdf((above_low.log() - below_high.log() - self.loc) / self.scale)
        return torch.where(outside, (value >= self.high).to(inside.dtype), inside)

    def icdf(self, value: Tensor) -> Tensor:
        """Return the quantile of probability value, `[...]`; strictly inside the bounds, NaN beyond [0, 1]."""
        return self.latent_to_value(normal_quantile(value, self.loc, self.scale))

    def entropy(self) -> Tensor:
        """Return the differential entropy `[...]` in nats, the interval's length included.

        It depends on loc (unlike a Normal's), and in scale it rises to a maximum and falls again, when the mass
        has gone to the bounds.
        """
        return self._normal().entropy() + self.width.log() + self._expect(_log_slope)

    # ---- the centre and the spread

    @property
    def mean(self) -> Tensor:
        """`[...]` mean of the value, by quadrature; within the bounds, which rounding could leave by a last bit."""
        return torch.clamp(self.low + self.width * self._expect(torch.sigmoid), self.low, self.high)

    @property
    def variance(self) -> Tensor:
        """`[...]` variance of the value, by quadrature about the median: no cancellation at any scale."""
        loc, scale = self.loc.unsqueeze(-1), self.scale.unsqueeze(-1)
        nodes, weights = graded_trapezoid(self.loc, self.scale)
        deviation = _sigmoid_difference(loc, scale * nodes)  # [..., N] of the unit value from its median
        unit_variance = (weights * deviation.square()).sum(-1) - (weights * deviation).sum(-1).square()
        return self.width.square() * unit_variance

    @property
    def median(self) -> Tensor:
        """`[...]` median of the value: the image of loc, exactly. The one centre that is invariant."""
        return self.latent_to_value(self.loc)

    @property
    def mode(self) -> Tensor:
        """`[...]` where the density over values is highest: the image of `mode_latent`."""
        return self.latent_to_value(self.mode_latent)

    @property
    def mode_latent(self) -> Tensor:
        """`[...]` latent of the (higher) mode: the root of z = μ + σ² tanh(z/2) on μ's side of zero.

        Differentiable in loc and scale, twice and more, by two Newton steps taken inside the graph from a root found
        outside of it: the first makes the first derivative right, the second the next two. Two places have no
        derivative: the cusp (μ = 0, σ² = 2), where it is infinite, and the ties (μ = 0, σ² > 2), where the mode
        jumps from one side to the other; at a tie the upper mode is returned.
        """
        root = self._mode_root()
        for _ in range(2):
            root = _newton_step(root, self.loc, self.scale)
        return root

    @property
    def is_bimodal(self) -> Tensor:
        """`[...]` bool, two modes or one: σ² > 2 and |μ| < σ²k − 2 artanh k, with k = √(1 − 2/σ²).

        2 artanh k is evaluated as 2 log(1 + k) + log(σ²/2), which stays finite where k rounds to one.
        """
        variance = self.scale.square()
        k = (1 - 2 / variance).clamp(min=0).sqrt()
        reach = variance * k - 2 * torch.log1p(k) - torch.log(variance / 2)
        return (variance > 2) & (self.loc.abs() < reach)

    # ---- helpers

    def _expect(self, function: Any) -> Tensor:
        return expectation(function, self.loc, self.scale, graded_trapezoid(self.loc, self.scale))

    def _mode_root(self) -> Tensor:
        """Return the root on μ's side of zero, outside the graph.

        For μ ≥ 0 and z ≥ 0, z − μ − σ² tanh(z/2) is convex, not positive at μ and positive at μ + σ²: Newton's method
        from the right end falls monotonically to the one root. The clamp to that bracket only absorbs rounding.
        """
        with torch.no_grad():  # as a decorator, torch.compile could not trace it
            loc, variance = self.loc.abs(), self.scale.square()
            root = loc + variance
            for _ in range(_NEWTON_STEPS):
                root = torch.clamp(_newton_step(root, loc, self.scale), loc, loc + variance)
            return torch.where(self.loc < 0, -root, root)


def _newton_step(z: Tensor, loc: Tensor, scale: Tensor) -> Tensor:
    """Return z after one Newton step on g(z) = z − loc − scale² tanh(z/2)."""
    variance, tanh = scale.square(), torch.tanh(z / 2)
    slope = 1 - variance / 2 * (1 - tanh.square())
    slope = torch.where(slope == 0, torch.ones_like(slope), slope)  # at the cusp, z = 0 is the root already
    return z - (z - loc - variance * tanh) / slope


def _log_slope(latent: Tensor) -> Tensor:
    """Return log sigmoid'(z) = log sigmoid(z) + log sigmoid(−z) = −softplus(−z) − softplus(z)."""
    return logsigmoid(latent) + logsigmoid(-latent)


def _sigmoid_difference(z: Tensor, step: Tensor) -> Tensor:
    """Return sigmoid(z + step) − sigmoid(z) with full relative precision, however small the step or large |z|.

    For a ≥ b: sigmoid(a) − sigmoid(b) = sigmoid(a) · sigmoid(−b) · (1 − exp(b − a)).
    """
    upper, lower = torch.maximum(z, z + step), torch.minimum(z, z + step)
    return step.sign() * torch.sigmoid(upper) * torch.sigmoid(-lower) * -torch.expm1(-step.abs())


@register_kl(LogitNormal, LogitNormal)
def _kl_logit_normal_logit_normal(p: LogitNormal, q: LogitNormal) -> Tensor:
    """Return KL(p‖q) of the latent Normals, in nats, elementwise: exact, as KL is invariant under a bijection."""
    require_equal_bounds(p, q)
    return _kl_normal_normal(p._normal(), q._normal())  # found here, for `torch.compile` cannot look it up
