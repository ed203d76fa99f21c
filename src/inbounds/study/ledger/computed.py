"""Evidence that needs no cell: claims of mathematics and of cost, computed where they are asked for.

Exact numbers are errors of computing; those that depend on drawn seeds come with an interval over seeds, times with
one over repeats.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence

import numpy as np
import torch
from scipy import integrate
from scipy.special import expit, logit

from inbounds.distributions import LogitNormal
from inbounds.learning import ActorCritic, NetworkConfig, Policy, PolicyConfig, Trainer, preset, trpo
from inbounds.learning.updates.threads import one_thread
from inbounds.study.ledger.evidence import side
from inbounds.study.ledger.half_of_a_gap import half_left
from inbounds.study.ledger.untrained_returns import LOUD, untrained
from inbounds.study.ledger.verdicts import Evidence, State, Statement
from inbounds.study.outcomes import Floats, Outcomes
from inbounds.study.statistics import Estimate, combination
from inbounds.study.statistics.settings import LEVEL

EXACT = 1e-6
"""Relative error below which two ways to compute one number agree."""
OFF = 0.1
"""Relative error that matters of a product with the Fisher matrix; an error of some size has every estimate."""
_SEEDS, _STATES, _REPEATS = 10, 128, 10
_CASES = ((0.0, 1.0, 0.3, 0.8), (-1.5, 0.5, 0.5, 1.6), (2.0, 2.5, -1.0, 0.7))  # μ, σ of P, then of Q


def agrees(about: str, error: Callable[[], float], *, claimed: bool) -> Evidence:
    """Two ways to compute a number agree to `EXACT`.

    `claimed`: the claim is that they do, else that it cannot be computed.
    """

    def find(_: Outcomes) -> list[Statement]:
        off = np.asarray(error())
        state: State = "for" if bool(off < EXACT) == claimed else "against"
        return [Statement(about, state, Estimate(off, off, off, 1, 0, LEVEL, "relative error"), exact=True)]

    return find


def error_of_closed_kl() -> float:
    """Return the relative error of the Normals' KL as that of logit-normals, against quadrature over actions."""
    errors = []
    for loc, scale, loc_q, scale_q in _CASES:
        p, q = (_law(m, s) for m, s in ((loc, scale), (loc_q, scale_q)))

        def integrand(z: float, p: LogitNormal = p, q: LogitNormal = q) -> float:
            a = torch.tensor(z, dtype=torch.float64).sigmoid()
            slope = (a * (1 - a)).item()  # of the action by z: the integral runs over actions
            return float(p.log_prob(a).exp() * (p.log_prob(a) - q.log_prob(a))) * slope

        ends = loc - 8 * scale, loc + 8 * scale
        measured, _ = integrate.quad(integrand, *ends, limit=400, epsabs=1e-12, epsrel=1e-10)
        closed = np.log(scale_q / scale) + (scale**2 + (loc - loc_q) ** 2) / (2 * scale_q**2) - 0.5
        errors.append(abs(measured / closed - 1))
    return max(errors)


def error_of_beta_fisher() -> float:
    """Return the relative error of vᵀFv of a Beta policy: TRPO's product against the trigamma functions.

    The Fisher matrix of a Beta is diag(ψ′(α), ψ′(β)) − ψ′(α + β); along v the outputs move by their
    differences.
    """
    generator = torch.Generator().manual_seed(0)
    policy = Policy(PolicyConfig("beta"), low=-np.ones(2), high=np.ones(2))
    networks = ActorCritic(policy, 3, NetworkConfig(policy_head_gain=1.0, dtype="float64"), [generator])
    obs = torch.randn(1, 64, 3, generator=generator, dtype=torch.float64)
    theta, v = (
        networks.actor.theta,
        torch.randn(networks.actor.theta.shape, generator=generator, dtype=torch.float64),
    )
    product = (trpo.kl_hessian_product(networks, obs)(v) * v).sum()
    with torch.no_grad():
        here, sides = networks.parameters(obs), []
        for step in (1e-5, -2e-5):
            theta += step * v
            sides.append(networks.parameters(obs))
    along = [(up - down) / 2e-5 for up, down in zip(*sides, strict=True)]
    own = sum(torch.polygamma(1, x) * d**2 for x, d in zip(here, along, strict=True))
    alpha, beta = here
    shared = torch.polygamma(1, alpha + beta) * sum(along) ** 2
    return abs(product.item() / ((own - shared).sum() / obs.shape[1]).item() - 1)


def error_of_centres() -> float:
    """Return the relative error of the logit-normal's mean and mode, against quadrature and the density itself.

    At the mode the density's slope is zero, and on a fine grid the density is nowhere larger.
    """
    errors = []
    for loc, scale in ((0.4, 0.5), (1.0, 1.4), (-2.0, 2.5)):
        law = _law(loc, scale)

        def weighted(t: float, loc: float = loc, scale: float = scale) -> float:
            return float(expit(loc + scale * t) * np.exp(-(t**2) / 2) / np.sqrt(2 * np.pi))

        mean, _ = integrate.quad(weighted, -9, 9, epsabs=1e-13, epsrel=1e-12, limit=400)
        z = logit(law.mode.item())
        elsewhere = law.log_prob(torch.linspace(1e-4, 1 - 1e-4, 9999, dtype=torch.float64)).max()
        errors.append(max(0.0, (elsewhere - law.log_prob(law.mode)).item()))
        errors += [abs(law.mean.item() / mean - 1), abs((loc + scale**2 * np.tanh(z / 2)) / z - 1)]
    return max(errors)


def _law(loc: float, scale: float) -> LogitNormal:
    return LogitNormal(
        torch.tensor(loc, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64), 0.0, 1.0
    )


def loud_starts(robots: Sequence[str]) -> Evidence:
    """Of the gap between untrained logit-normals and Gaussians at least half is left where both are `LOUD`.

    The loud logit-normal never leaves the box, the loud Gaussian does. The four groups share their seeds' first weights
    and starts, and are treated as independent like all others here; intervals over pairs decide no robot otherwise.
    """

    def find(_: Outcomes) -> list[Statement]:
        found = []
        for robot in robots:
            loud, default = (
                [untrained(family, robot, std) for family in ("logit-normal", "gaussian")]
                for std in (LOUD, None)
            )
            found.append(half_left(robot, loud, default, claimed=True))
        return found

    return find


def bill_of_leaving(robot: str) -> Evidence:
    """Of the deficit of untrained Gaussians charged as drawn, at least half is the bill for leaving the box.

    The bill is what they earn more where actions are clipped before the reward sees them; the motion is the same.
    """

    def find(_: Outcomes) -> list[Statement]:
        logit_normal, clipped = (untrained(family, robot) for family in ("logit-normal", "gaussian"))
        drawn = untrained("gaussian", robot, mode="raw")
        return [half_left(robot, [clipped, drawn], [logit_normal, drawn], claimed=True, one_base=True)]

    return find


def sampled_error(_: Outcomes) -> list[Statement]:
    """State that the sampled Fisher-vector product is off: its relative error, over seeds. For: above `OFF`."""
    error = combination([_fisher_routes()[0]], [1])
    return [Statement("relative error of the sampled product", side(error, 1, OFF), error, digits=3)]


def sampled_time(_: Outcomes) -> list[Statement]:
    """State that the sampled product takes longer: its time over the closed form's, over repeats. For: above 1."""
    ratio = combination([_fisher_routes()[1]], [1])
    return [
        Statement("its processor time over that of the closed form", side(ratio, 1, 1.0), ratio, digits=2)
    ]


@functools.cache
def _fisher_routes() -> tuple[Floats, Floats]:
    """Relative error of the sampled product of each seed, and the ratios of the times."""
    with one_thread():
        config = preset("common", "Swimmer-v5", policy="logit-normal", algo="trpo", seeds=_SEEDS, epochs=1)
        trainer = Trainer(config)
        rollout = trainer.collector.collect(_STATES)
        networks, generator = trainer.networks, torch.Generator().manual_seed(0)
        vector = torch.randn(networks.actor.theta.shape, generator=generator)
        routes = (
            lambda: trpo.kl_hessian_product(networks, rollout.obs),
            lambda: trpo.sampled_fisher_product(networks, rollout.obs, rollout.latent),
        )
        exact, sampled = (route()(vector) for route in routes)
        error = ((sampled - exact).norm(dim=1) / exact.norm(dim=1)).double().numpy()
        ratio = np.array([_seconds(routes[1], vector) / _seconds(routes[0], vector) for _ in range(_REPEATS)])
    return error, ratio


def _seconds(route: Callable[[], trpo.Product], vector: torch.Tensor) -> float:
    """Processor time of the eleven products of an update, preparation included."""
    before = time.process_time()
    product = route()
    for _ in range(11):
        product(vector)
    return time.process_time() - before
