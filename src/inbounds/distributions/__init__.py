"""What an action is drawn from: laws on an interval, each with its density, its centres and its KL divergence."""

from inbounds.distributions.bounds import BoundedDistribution
from inbounds.distributions.clipped_normal import ClippedNormal, gaussian_kl_upper_bound
from inbounds.distributions.logit_normal import LogitNormal
from inbounds.distributions.open_interval import OpenInterval
from inbounds.distributions.quadrature import Rule, expectation, gauss_hermite, graded_trapezoid, trapezoid
from inbounds.distributions.scaled_beta import ScaledBeta

__all__ = [
    "BoundedDistribution",
    "ClippedNormal",
    "LogitNormal",
    "OpenInterval",
    "Rule",
    "ScaledBeta",
    "expectation",
    "gauss_hermite",
    "gaussian_kl_upper_bound",
    "graded_trapezoid",
    "trapezoid",
]
