"""What the source thesis says of its results: who starts where, who wins, what happens on Swimmer.

Claims are paraphrased. "This book" marks an explanation that the book sets against a claim: it is put to the same test.
"""

from __future__ import annotations

from inbounds.study.analysis import Contrast
from inbounds.study.grid import LONG_GAMMA
from inbounds.study.ledger import computed
from inbounds.study.ledger.evidence import (
    START,
    beats,
    changes,
    equals,
    gaps,
    improves,
    together,
)
from inbounds.study.ledger.half_of_a_gap import half_remains
from inbounds.study.ledger.shared_names import (
    AS_THEY_START,
    EQUALLY_LOUD,
    LOUDNESS_CELLS,
    NOISY,
    PRESETS,
    TEST,
    cells,
    squash,
)
from inbounds.study.ledger.verdicts import Claim
from inbounds.study.outcomes import Column

_GAMMA = f"gamma-{LONG_GAMMA}"

_START = "Where the Gaussian starts"
STARTS = [
    *(
        Claim(
            f"start-{arm}",
            _START,
            f"With the Gaussian, every experiment starts from a much lower return ({words}).",
            "ch. 5, PPO; ch. 6, 2nd paragraph; ch. 7",
            f"First epoch, which the untrained policy plays: logit-normal − Gaussian above 0 on every "
            f"robot ({TEST}).",
            beats(squash("ppo", arm), START),
            cells(arm, "ppo", "gaussian", "logit-normal"),
        )
        for arm, words in PRESETS.items()
    ),
    Claim(
        "start-cause",
        _START,
        "The Gaussian starts low because its samples leave the box.",
        "ch. 6, 2nd paragraph",
        f"Untrained policies: where both families execute noise of {computed.LOUD}, and only the Gaussian leaves "
        "the box, at least half of the gap (logit-normal − Gaussian) is left on every one of three robots.",
        computed.loud_starts(("HalfCheetah", "Hopper", "Walker2d")),
    ),
    Claim(
        "start-cause-drawn",
        _START,
        "The Gaussian starts low because its samples leave the box, where the reward charges for the action as drawn.",
        "ch. 6, 2nd paragraph, with the condition of results/JUDGED-ANEW.md",
        "Untrained policies on HalfCheetah: of the gap (logit-normal − Gaussian charged as drawn) at least half is the "
        "bill for leaving the box (Gaussian clipped first − Gaussian charged as drawn).",
        computed.bill_of_leaving("HalfCheetah"),
    ),
    Claim(
        "start-noise",
        _START,
        "With equal executed noise less than half of the Gaussian's gap at the start is left.",
        "this book, Part IV",
        "First epoch: with equal executed noise (0.4) less than half of the gap (logit-normal − Gaussian) is left on "
        "every robot with such cells that has one.",
        half_remains(
            EQUALLY_LOUD,
            AS_THEY_START,
            NOISY,
            START,
            claimed=False,
        ),
        LOUDNESS_CELLS,
    ),
    Claim(
        "start-raw",
        _START,
        "The Gaussian starts lower still where the reward charges for the action as drawn, beyond the box.",
        "this book, Part I",
        "First epoch, Gaussian: raw cost − clipped cost below 0 on both robots.",
        changes(cells("mechanisms", "ppo", "gaussian-raw-cost"), -1, START),
        (
            *cells("standard", "ppo", "gaussian", robots=("HalfCheetah", "Ant")),
            *cells("mechanisms", "ppo", "gaussian-raw-cost"),
        ),
    ),
]

_WINS = "Who wins"
WINS = [
    *(
        Claim(
            f"wins-{algorithm}-{arm}",
            _WINS,
            f"The logit-normal beats the Gaussian on four of six robots ({algorithm.upper()}, {words}).",
            "abstract; ch. 6, 1st paragraph",
            f"Final return: logit-normal − Gaussian above 0 on at least four robots ({TEST}).",
            beats(squash(algorithm, arm)),
            cells(arm, algorithm, "gaussian", "logit-normal"),
            needed=4,
            planned=True,
        )
        for arm, words in PRESETS.items()
        for algorithm in ("ppo", "trpo")
    ),
    *(
        Claim(
            f"wins-beta-{arm}",
            _WINS,
            f"The Beta beats the Gaussian on four of six robots (PPO, {words}).",
            "ch. 5, PPO; ch. 6, 1st paragraph",
            f"Final return: Beta − Gaussian above 0 on at least four robots ({TEST}).",
            beats(Contrast(arm, "ppo", "beta", "gaussian")),
            cells(arm, "ppo", "gaussian", "beta"),
            needed=4,
            planned=True,
        )
        for arm, words in PRESETS.items()
    ),
    *(
        Claim(
            f"overall-{arm}",
            _WINS,
            f"The logit-normal generally surpasses the Gaussian ({words}).",
            "ch. 7",
            "Probability that a random run of the logit-normal ends above one of the Gaussian, mean over "
            "robots: above ½ under PPO and under TRPO.",
            improves([squash("ppo", arm), squash("trpo", arm)]),
            tuple(p for a in ("ppo", "trpo") for p in cells(arm, a, "gaussian", "logit-normal")),
            planned=True,
        )
        for arm, words in PRESETS.items()
    ),
    Claim(
        "faster",
        _WINS,
        "On HalfCheetah and Humanoid the logit-normal learns faster than both others (PPO).",
        "ch. 5, PPO",
        f"Area under the learning curve, as printed: above both on both robots ({TEST}).",
        together(
            *(
                beats(Contrast("printed", "ppo", "logit-normal", other), "area", ("HalfCheetah", "Humanoid"))
                for other in ("gaussian", "beta")
            )
        ),
        cells("printed", "ppo", "gaussian", "beta", "logit-normal", robots=("HalfCheetah", "Humanoid")),
        planned=True,
    ),
    Claim(
        "ties",
        _WINS,
        "On Hopper, Walker2d and Ant the three differ by little (PPO).",
        "ch. 5, PPO",
        "Final return, as printed: each difference within a tenth of what PPO × Gaussian learns (in "
        "standard practice).",
        together(
            *(
                equals(Contrast("printed", "ppo", first, second), ("Hopper", "Walker2d", "Ant"))
                for first, second in (
                    ("logit-normal", "gaussian"),
                    ("beta", "gaussian"),
                    ("logit-normal", "beta"),
                )
            )
        ),
        (
            *cells(
                "printed", "ppo", "gaussian", "beta", "logit-normal", robots=("Hopper", "Walker2d", "Ant")
            ),
            *cells("standard", "ppo", "gaussian", robots=("Hopper", "Walker2d", "Ant")),
        ),
    ),
    Claim(
        "trpo-named",
        _WINS,
        "Under TRPO the logit-normal is ahead on Walker2d, Ant, HalfCheetah and Humanoid, and behind on "
        "Hopper and Swimmer.",
        "ch. 5, TRPO",
        f"Final return, as printed: logit-normal − Gaussian on the side named, on all six ({TEST}).",
        beats(
            squash("trpo", "printed"),
            robots=("Walker2d", "Ant", "HalfCheetah", "Humanoid"),
            below=("Hopper", "Swimmer"),
        ),
        cells("printed", "trpo", "gaussian", "logit-normal"),
        planned=True,
    ),
]

_SWIMMER = "Swimmer"
_FIRST = [("ppo", "logit-normal"), ("ppo", "beta"), ("trpo", "logit-normal")]
SWIMMER = [
    *(
        Claim(
            f"swimmer-{arm}",
            _SWIMMER,
            f"On Swimmer the Gaussian ends above the others ({words}).",
            "ch. 5, PPO and TRPO",
            f"Final return: the other − Gaussian below 0, PPO and TRPO ({TEST}).",
            together(
                *(
                    beats(Contrast(arm, a, other, "gaussian"), robots=(), below=("Swimmer",))
                    for a, other in _FIRST
                )
            ),
            (
                *cells(arm, "ppo", "gaussian", "beta", "logit-normal", robots=("Swimmer",)),
                *cells(arm, "trpo", "gaussian", "logit-normal", robots=("Swimmer",)),
            ),
            planned=True,
        )
        for arm, words in PRESETS.items()
    ),
    Claim(
        "swimmer-gamma",
        _SWIMMER,
        "With a discount of 0.9999 all of them end higher on Swimmer.",
        "this book, Part IV",
        "Final return with 0.9999 − with 0.99: above 0 in all six columns.",
        changes(cells("mechanisms", "*", f"*-{_GAMMA}"), 1),
        (
            *cells("mechanisms", "*", f"*-{_GAMMA}"),
            *cells("standard", "*", "*", robots=("Swimmer",)),
            *cells("beyond", "trpo", "beta", robots=("Swimmer",)),
        ),
        planned=True,
    ),
    Claim(
        "swimmer-order",
        _SWIMMER,
        "With the longer horizon the Gaussian is still ahead on Swimmer.",
        "follows from ch. 5",
        "Final return with 0.9999: Gaussian − other above 0, PPO and TRPO, Beta and logit-normal.",
        gaps(
            [
                (Column("mechanisms", a, "gaussian", _GAMMA), Column("mechanisms", a, other, _GAMMA))
                for a in ("ppo", "trpo")
                for other in ("beta", "logit-normal")
            ],
            "Swimmer",
        ),
        cells("mechanisms", "*", f"*-{_GAMMA}"),
    ),
]
