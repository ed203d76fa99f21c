"""What the source thesis says of reasons and methods: the box, entropy, parameters, trust regions, centres."""

from __future__ import annotations

from scipy.special import logit

from inbounds.study.grid import ROBOTS
from inbounds.study.ledger import computed
from inbounds.study.ledger.evidence import costs, exceeds, learns
from inbounds.study.ledger.half_of_a_gap import half_remains
from inbounds.study.ledger.shared_names import AS_THEY_START, EQUALLY_LOUD, LOUDNESS_CELLS, NOISY, cells
from inbounds.study.ledger.verdicts import Claim
from inbounds.study.outcomes import Column

_CAUSE = "Whether the box is the cause"
CAUSES = [
    Claim(
        "cause-noise",
        _CAUSE,
        "The gain comes from the bounded support.",
        "ch. 5, 1st paragraph; ch. 6, 1st paragraph; ch. 7",
        "Final return: with equal executed noise at the start, at least half of the gain (logit-normal − "
        "Gaussian) is left on every robot with such cells that has one. (That would exclude the noise at the "
        "start as the cause; it would not show that the bounds are it.)",
        half_remains(
            EQUALLY_LOUD,
            AS_THEY_START,
            NOISY,
            "final",
        ),
        LOUDNESS_CELLS,
    ),
    Claim(
        "cause-capg",
        _CAUSE,
        "What hurts the Gaussian is that its objective ignores the clipping.",
        "this book's reading of ch. 1 and of ch. 6, 1st paragraph",
        "Final return: CAPG, which takes the clipping into account, gains at least half of what the "
        "logit-normal gains, on every robot on which that gains.",
        half_remains(
            (Column("beyond", "ppo", "clipped-gaussian"), Column("standard", "ppo", "gaussian")),
            (Column("standard", "ppo", "logit-normal"), Column("standard", "ppo", "gaussian")),
            ROBOTS,
            "final",
        ),
        (
            *cells("standard", "ppo", "gaussian", "logit-normal"),
            *cells("beyond", "ppo", "clipped-gaussian"),
        ),
    ),
]

_PARTS = "Entropy, parameters, clip range"
PARTS = [
    Claim(
        "beta-entropy",
        _PARTS,
        "A Beta policy needs the entropy bonus.",
        "ch. 4; ch. 6, 4th paragraph",
        "Final return without the bonus − with it (1e-4): below minus a tenth of what PPO × Gaussian "
        "learns, on both robots.",
        costs(cells("mechanisms", "ppo", "beta-entropy-0"), claimed=True),
        (
            *cells("mechanisms", "ppo", "beta-entropy-0"),
            *cells("standard", "ppo", "gaussian", "beta", robots=("HalfCheetah", "Hopper")),
        ),
    ),
    Claim(
        "large-logit-normal",
        _PARTS,
        "The parameters of the logit-normal become large in some cases.",
        "ch. 6, 3rd paragraph",
        "Last measurements, as printed: in at least one cell the 99 % quantile of |μ| lies where the "
        "median action is within 1 % of the range from a bound.",
        exceeds(
            tuple(p for a in ("ppo", "trpo") for p in cells("printed", a, "logit-normal")),
            ["abs_loc_q99"],
            float(logit(0.99)),
            digits=1,
        ),
        tuple(p for a in ("ppo", "trpo") for p in cells("printed", a, "logit-normal")),
        needed=1,
    ),
    Claim(
        "large-beta",
        _PARTS,
        "The parameters of the Beta become large in some cases.",
        "ch. 6, 3rd paragraph",
        "Last measurements, as printed: in at least one cell more than 1 % of the α and β are at their "
        "cap of 80.",
        exceeds(cells("printed", "ppo", "beta"), ["at_alpha_max", "at_beta_max"], 0.02, digits=3),
        cells("printed", "ppo", "beta"),
        needed=1,
    ),
    Claim(
        "clip",
        _PARTS,
        "A clip range of 0.02 serves.",
        "Table A.1",
        "Final return with 0.02 − with 0.2: above minus a tenth of what PPO × Gaussian learns, in all "
        "four cells.",
        costs(cells("mechanisms", "ppo", "*-printed-clip"), claimed=False),
        (
            *cells("mechanisms", "ppo", "*-printed-clip"),
            *cells("standard", "ppo", "gaussian", "logit-normal", robots=("HalfCheetah", "Hopper")),
        ),
    ),
]

_TRUST = "Trust regions and centres"
TRUST = [
    Claim(
        "kl",
        _TRUST,
        "The KL divergence of two logit-normals is that of their Gaussians.",
        "section 3.2",
        f"Closed form against quadrature over actions: relative error below {computed.EXACT:.0e}.",
        computed.agrees("largest relative error", computed.error_of_closed_kl, claimed=True),
    ),
    Claim(
        "fisher-error",
        _TRUST,
        "The Hessian of a closed-form KL is better than a sampled Fisher matrix: it does not depend on "
        "the actions drawn.",
        "section 2.3",
        "Products with a vector, ten seeds of Swimmer, 128 states each, one action per state: the "
        f"sampled product is off by more than {computed.OFF:.0%}.",
        computed.sampled_error,
    ),
    Claim(
        "fisher-time",
        _TRUST,
        "The Hessian of a closed-form KL is also cheaper than a sampled Fisher matrix.",
        "section 2.3",
        "Processor time of the eleven products of an update: the sampled ones take longer. Measured when "
        "the page was built.",
        computed.sampled_time,
    ),
    Claim(
        "beta-hessian",
        _TRUST,
        "The Hessian of the Beta's KL, computed analytically, meets a numerical problem.",
        "section 2.5; ch. 4",
        "It does not, in double precision: automatic differentiation against the trigamma functions, relative error "
        f"below {computed.EXACT:.0e}, counts against.",
        computed.agrees("relative error of vᵀFv", computed.error_of_beta_fisher, claimed=False),
    ),
    Claim(
        "beta-trpo",
        _TRUST,
        "TRPO is not practicable with a Beta policy.",
        "ch. 1; ch. 4; ch. 5, TRPO",
        "Final return − first epoch's, seed by seed: above 0 on any robot counts against.",
        learns(Column("beyond", "trpo", "beta"), sign=-1),
        cells("beyond", "trpo", "beta"),
    ),
    Claim(
        "centres",
        _TRUST,
        "Mean and mode of the logit-normal are an open problem.",
        "section 3.3; ch. 6, last paragraph",
        "They are not: this package's mean against quadrature, its mode against the slope and the values of the "
        f"density; relative errors below {computed.EXACT:.0e} count against.",
        computed.agrees("largest relative error", computed.error_of_centres, claimed=False),
    ),
]
