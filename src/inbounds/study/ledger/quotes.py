"""The thesis's own words behind each row of the ledger, and the rows that were judged anew (`results/JUDGED-ANEW.md`).

A row counts in the thesis's tally if a sentence of the thesis makes the claim, and if the sentence is judged as
strongly, and under the conditions, as it is meant. All other rows count in a tally of this book's own.

    python -m inbounds.study.ledger.quotes thesis.txt     are the words in the thesis's text? whoever has it can ask
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from inbounds.study.ledger.verdicts import Claim, Finding


@dataclass(frozen=True)
class Quote:
    """A sentence, or part of one.

    Example:
        >>> QUOTES["overall"].place
        'chapter 7'
    """

    words: str
    """As they are printed."""
    place: str
    """Chapter or section."""


_FOUR = Quote(
    "In the four environments both in PPO and TRPO, the Logitnormal policy led the highest performance as Beta policy "
    "did.",
    "chapter 6",
)
_CAUSE = Quote(
    "The performance starts at relatively low score before training because they have a high probability to select the "
    "actions out of the boundary.",
    "chapter 6",
)
_FISHER = Quote(
    "Usually the latter way is better because it only depends on the states, not on the actions, and is "
    "computationally efficient in the large-scale setting",
    "section 2.3",
)
_LARGE = Quote(
    "The drawback of Beta distribution and Logitnormal distribution is that the parameters scale becomes large in some "
    "cases.",
    "chapter 6",
)
QUOTES: Mapping[str, Quote] = MappingProxyType(
    {
        "start": Quote(
            "What is striking in these results is that each experiment starts with a very poor performance in the case "
            "of Gaussian policy.",
            "chapter 6",
        ),
        "start-cause": _CAUSE,
        "start-cause-drawn": _CAUSE,
        "wins-ppo": _FOUR,
        "wins-trpo": _FOUR,
        "wins-beta": _FOUR,
        "overall": Quote(
            "In the experiments on MuJoCo simulation, Logitnormal policy generally surpasses Gaussian policy.",
            "chapter 7",
        ),
        "faster": Quote(
            "Specifically, in HalfCheetah-v2 and Humanoid-v2, Logitnormal policy trained faster than the other two "
            "distributions.",
            "chapter 5",
        ),
        "ties": Quote(
            "In Hopper-v2, Walker2d-v2 and Ant-v2, all three distributions performed well with tiny differences.",
            "chapter 5",
        ),
        "trpo-named": Quote(
            "In Walker2d-v2, Ant, HalfCheetah and Humanoid-v2, Logitnormal policy surpassed Gaussian policy greatfully "
            "and underperformed in the rest of two environments.",
            "chapter 5",
        ),
        "swimmer": Quote(
            "However, in Swimmer-v2, Gaussian policy outperformed the other two distributions after around 80 "
            "iterations.",
            "chapter 5",
        ),
        "cause-noise": Quote(
            "We conducted the experiments to evaluate performance improvements of Logitnormal distribution from "
            "addressing the boundary effect.",
            "chapter 5",
        ),
        "beta-entropy": Quote(
            "This is essential for Beta policy since it has no scale parameter to clip.", "chapter 4"
        ),
        "large-logit-normal": _LARGE,
        "large-beta": _LARGE,
        "kl": Quote(
            "Logitnormal distribution has the same KL-divergence as Gaussian distribution, which contributes to "
            "enabling TRPO.",
            "chapter 7",
        ),
        "fisher-error": _FISHER,
        "fisher-time": _FISHER,
        "beta-hessian": Quote(
            "Beta policy has its limit to calculate Hessian of KL-divergence analytically due to numerical problem "
            "with digamma function which is one of the components of the formula.",
            "chapter 4",
        ),
        "beta-trpo": Quote("since it is difficult to calculate KL-divergence of Beta policy", "chapter 5"),
        "centres": Quote(
            "Since it turned out that obtaining mode and mean in a closed-form is impossible, the numerical method is "
            "the only to get those.",
            "chapter 6",
        ),
    }
)
"""Row → the sentence that makes the claim; rows of both presets share one, under the name without the preset."""

NOT_TESTED: Mapping[str, str] = MappingProxyType(
    {
        "fisher-time": "the thesis speaks of the large-scale setting, and small networks were timed (rule 2)",
        "beta-trpo": "the thesis says difficult, which a run that works does not refute (rule 3)",
        "centres": "the thesis says that there is no closed form, and this book's methods are numerical (rule 3)",
    }
)
"""Row → why the run does not test the thesis's sentence."""

MOST = Quote(
    "Beta policy and Logitnormal Policy tended to surpass Gaussian policy in most of the environments.",
    "chapter 5",
)
"""One sentence about two policies: it is read in the same way for both (rule 4; `inbounds.study.ledger.most`)."""
ALL: Mapping[str, Quote] = MappingProxyType({**QUOTES, "most": MOST})
"""Every sentence that is quoted, those of the rows first."""


def quote(claim: Claim) -> Quote | None:
    """Return the thesis's words behind a row; None for a row that is this book's own.

    Example:
        >>> from inbounds.study.ledger import claims_named
        >>> quote(claims_named(["start-raw"])[0]) is None
        True
    """
    return QUOTES.get(claim.id) or QUOTES.get(claim.id.removesuffix("-printed").removesuffix("-standard"))


def verdict(finding: Finding) -> str:
    """Return supported, refuted, undecided or not tested.

    Example:
        >>> from inbounds.study.ledger import Finding, claims_named
        >>> verdict(Finding(claims_named(["beta-trpo"])[0], (), 0, 0))
        'not tested'
    """
    return "not tested" if finding.claim.id in NOT_TESTED else finding.verdict


def judged_anew(finding: Finding) -> str:
    """Return why a row does not test the thesis's sentence, and its verdict before; nothing where it does.

    Example:
        >>> from inbounds.study.ledger import Finding, claims_named
        >>> judged_anew(Finding(claims_named(["centres"])[0], (), 0, 0)).endswith("(rule 3). Before: undecided.")
        True
    """
    reason = NOT_TESTED.get(finding.claim.id)
    return f"{reason}. Before: {finding.verdict}." if reason else ""


def thesis_and_book(found: Sequence[Finding]) -> tuple[list[Finding], list[Finding]]:
    """Return the rows that quote the thesis, and this book's own.

    Example:
        >>> thesis_and_book([])
        ([], [])
    """
    thesis = [each for each in found if quote(each.claim) is not None]
    return thesis, [each for each in found if each not in thesis]


def not_in(text: str) -> list[str]:
    """Return the names of the quotes whose words a text does not have, spaces, line ends and hyphens apart.

    Args:
        text: of the thesis.

    Example:
        >>> not_in("") == list(ALL)
        True
    """

    def bare(words: str) -> str:
        return re.sub(r"[\s-]+", "", words)

    return [name for name, quoted in ALL.items() if bare(quoted.words) not in bare(text)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Look for every quotation in the text of the thesis.")
    parser.add_argument("text", type=Path, help="the thesis as plain text")
    lacking = not_in(parser.parse_args().text.read_text(encoding="utf8"))
    print(
        "\n".join(f"not in the text: {name}" for name in lacking) or f"all {len(ALL)} quotes are in the text"
    )
    sys.exit(bool(lacking))
