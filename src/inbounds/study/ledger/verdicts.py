"""A claim, its statements, and the rule by which they decide it: counting, without a look at any result.

A **claim** is taken apart into **statements**, numbers with intervals: one per robot, say. Each statement is *for* the
claim, *against* it, *open* (its interval leaves both possible), *moot* (there is nothing to explain on that robot) or
*missing* (a cell is not finished). The claim names how many of its statements must hold. Its verdict:

* **supported**: so many hold, whatever the others say;
* **refuted**: so many are against it that the rest could not make up for them, were they all to hold;
* **undecided**: otherwise. Open and missing statements decide nothing.

So a cell that arrives later changes no verdict but "undecided": it fills in what was missing, and can only lower the
p-values of other robots, since a missing robot counts as the last in Holm's correction. Each kind of evidence says when
a statement is for or against (`inbounds.study.ledger.evidence`).

For the same reason one can say of an undecided claim what is out of reach (`Finding.outlook`): an interval that leaves
both possible stays as it is, whatever else arrives. Where the interval is clear and Holm's correction is not, the test
may still find it, if the p-value would pass were all robots that are missing as clear as can be.

The protocol of the study fixes endpoints, differences, tests and intervals. This rule, the margins and the list of
claims were added when three of the 136 cells were known: PPO on HalfCheetah, in standard practice. When a fourth was,
TRPO × gaussian there, three things were mended, none of which has to do with these four: a loss counts as one that
matters where its interval lies beyond the margin, not beyond 0; a group that is part of two gaps is drawn once; and the
error of a sampled product must exceed a tenth, not 0. The outlook was added when twenty cells were finished, and a gap
that is not clear was first told before its explanation was there when twenty-two were; both follow from the rule, and
change no verdict.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from inbounds.study.grid import select
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics import Estimate
from inbounds.study.words import p_equals, spoken

State: TypeAlias = Literal["for", "against", "open", "moot", "missing"]
Verdict: TypeAlias = Literal["supported", "refuted", "undecided"]
STATES: tuple[State, ...] = get_args(State)
STAYS = "stays undecided"
"""Said of a claim that no cell can decide any more."""


@dataclass(frozen=True)
class Statement:
    """One of the things that a claim says, as a number.

    Part of what `judge` returns, which has an example.
    """

    about: str
    """What of: "Hopper", "Ant, logit-normal − gaussian"."""
    state: State
    """What it says to the claim."""
    estimate: Estimate | None = None
    """The number with its interval; None where it is missing."""
    p_adjusted: float = float("nan")
    """Of the protocol's test after Holm, where it has one."""
    digits: int | None = None
    """Decimals to be told; None suits returns."""
    exact: bool = False
    """Whether the number is an error of computing, which has no interval."""

    may_become: tuple[State, ...] = ()
    """What cells that are still missing could make of it; see `reachable`."""

    @property
    def reachable(self) -> tuple[State, ...]:
        """The states that it may end in, whatever cells arrive."""
        return STATES if self.state == "missing" else (self.state, *self.may_become)

    @property
    def by_holm(self) -> bool:
        """Whether its interval is clear, and only the corrected test leaves it open."""
        if self.estimate is None or self.state != "open" or np.isnan(self.p_adjusted):
            return False
        return not float(self.estimate.low) <= 0 <= float(self.estimate.high)

    def __str__(self) -> str:
        if self.estimate is None:
            return f"{self.about}: missing"
        if self.exact:
            return f"{self.about}: {float(self.estimate.value):.0e} ({self.state})"
        told = f", {p}" if (p := p_equals(self.p_adjusted)) else ""
        state = "open, not after Holm" if self.by_holm else self.state
        return f"{self.about}: {spoken(self.estimate, self.digits)}{told} ({state})"


Evidence: TypeAlias = Callable[[Outcomes], Sequence[Statement]]


@dataclass(frozen=True)
class Claim:
    """A claim and its test.

    Found by `claims_named` and judged by `judge`, which has an example.
    """

    id: str
    """Names it on the command line."""
    subject: str
    """What it belongs to."""
    says: str
    """The claim, in this book's words."""
    where: str
    """Where it is made."""
    test: str
    """What each statement is, and when it is for the claim."""
    evidence: Evidence
    """Finds the statements."""
    cells: tuple[str, ...] = ()
    """Patterns of the cells behind it, as `inbounds.study.select` reads them; none: computed on the spot."""
    needed: int | None = None
    """How many statements must hold; None is all that are not moot."""
    planned: bool = False
    """Whether its numbers are differences, endpoints and intervals that the protocol lists."""

    @property
    def standing(self) -> str:
        """How it stands to the protocol, which asks that what it does not list be called exploratory."""
        if not self.cells:
            return "computed, no cell of the study"
        return "listed in the protocol" if self.planned else "exploratory"

    @property
    def command(self) -> str:
        """What prints its statements anew."""
        return f"inbounds study ledger {self.id}"


@dataclass(frozen=True)
class Finding:
    """The judgement of a claim: its statements, and how many of the cells behind them are finished.

    Made by `judge`, which has an example.
    """

    claim: Claim
    """Which."""
    statements: tuple[Statement, ...]
    """In the claim's order."""
    finished: int
    """Cells behind it that are finished."""
    planned: int
    """Cells behind it altogether."""

    @property
    def verdict(self) -> Verdict:
        """What follows by counting."""
        return count([statement.state for statement in self.statements], self.claim.needed)

    @property
    def outlook(self) -> str:
        """What is out of reach of an undecided claim, in words; empty where missing cells may decide it either way."""
        if self.verdict != "undecided" or not self.claim.cells:  # without cells it is computed anew each time
            return ""
        possible = possible_verdicts([each.reachable for each in self.statements], self.claim.needed)
        if possible == {"undecided"}:
            return STAYS
        gone = [verdict for verdict in ("supported", "refuted") if verdict not in possible]
        return f"can no longer be {gone[0]}" if gone else ""

    @property
    def cells(self) -> str:
        """How many cells are behind it, in words."""
        return f"{self.finished} of {self.planned}" if self.planned else "none needed"

    @property
    def told(self) -> str:
        """What the statements say, a line each; those that are missing by name only, on the last."""
        tails = {statement.about.partition(", ")[2] for statement in self.statements}
        shared = f", {min(tails)}" if len(tails) == 1 and min(tails) else ""  # need not be said each time
        there = [str(s).replace(shared, "", 1) for s in self.statements if s.state != "missing"]
        gone = [s.about.removesuffix(shared) for s in self.statements if s.state == "missing"]
        listed = (", " if shared else "; ").join(gone)
        return "\n".join([*there, *([f"missing: {listed}"] if gone else [])])

    @property
    def counted(self) -> str:
        """How many statements are in which state, in words."""
        states = Counter(statement.state for statement in self.statements)
        told = [
            f"{states[state]} {state}"
            for state in ("for", "against", "open", "moot", "missing")
            if states[state]
        ]
        needed = len(self.statements) - states["moot"] if self.claim.needed is None else self.claim.needed
        return "; ".join(filter(None, [", ".join(told), f"needed: {needed}", self.outlook]))


def count(states: Sequence[State], needed: int | None = None) -> Verdict:
    """Return the verdict on a claim.

    Args:
        states: of its statements.
        needed: how many must hold; None is all that are not moot.

    Returns:
        "undecided" also where every statement is moot.

    Example:
        >>> [count(states, 2) for states in (["for"] * 2 + ["open"], ["for", "open"], ["against", "for"])]
        ['supported', 'undecided', 'refuted']
    """
    if needed is None:
        states = [state for state in states if state != "moot"]
        needed = max(1, len(states))
    if states.count("for") >= needed:
        return "supported"
    return "refuted" if states.count("against") > len(states) - needed >= 0 else "undecided"


def possible_verdicts(
    reachable: Sequence[Collection[State]], needed: int | None = None
) -> frozenset[Verdict]:
    """Return the verdicts that a claim may still get.

    Args:
        reachable: of each statement, the states that it may end in.
        needed: as in `count`.

    Example:
        >>> sorted(possible_verdicts([["for"], ["open"], ["open"], ["open"], STATES, STATES], needed=4))
        ['undecided']
    """
    endings: set[tuple[State, ...]] = {()}
    for states in reachable:  # the order of statements does not matter: far fewer endings than ways
        endings = {tuple(sorted((*ending, state))) for ending in endings for state in states}
    return frozenset(count(ending, needed) for ending in endings)


def judge(outcomes: Outcomes, claim: Claim) -> Finding:
    """Find the statements of a claim.

    Args:
        outcomes: of the study.
        claim: which.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> from inbounds.study.ledger import claims_named
        >>> from inbounds.study.outcomes import Outcomes
        >>> outcomes = Outcomes.read(StudyFolder())  # in the project's folder
        >>> judge(outcomes, *claims_named(["wins-beta-standard"])).verdict
        'supported'
    """
    behind = select(claim.cells) if claim.cells else ()
    finished = sum(cell.id in outcomes.finished for cell in behind)
    return Finding(claim, tuple(claim.evidence(outcomes)), finished, len(behind))
