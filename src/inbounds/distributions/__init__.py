"""What an action is drawn from: laws on an interval, each with its density, its centres and its KL divergence."""

from inbounds.distributions.logit_normal import LogitNormal
from inbounds.distributions.quadrature import Rule, expectation, gauss_hermite, graded_trapezoid, trapezoid

__all__ = ["LogitNormal", "Rule", "expectation", "gauss_hermite", "graded_trapezoid", "trapezoid"]
