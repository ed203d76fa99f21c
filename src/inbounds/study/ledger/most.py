"""One sentence of the thesis about two policies, read in the same way for both (rule 4 of `results/JUDGED-ANEW.md`).

Its chapter 5 says that Beta and logit-normal "tended to surpass Gaussian policy in most of the environments"
(`inbounds.study.ledger.quotes.MOST`). The words allow two readings. *Loose*: the mean is higher. *Strict*: the
difference is found. Both are counted for both policies, and "most" is the same number for all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from inbounds.study import analysis, statistics
from inbounds.study.analysis import Contrast
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Outcomes
from inbounds.study.words import verdict

NEEDED = len(ROBOTS) // 2 + 1
"""How many robots are most of six: the number that the rows `wins-ppo` and `wins-beta` ask for."""
POLICIES = ("beta", "logit-normal")


@dataclass(frozen=True)
class Reading:
    """What a policy's sentence comes to under PPO, by one endpoint.

    Example:
        >>> Reading("beta", "final", higher=5, found=4, lower=0, there=6, findable=4).strict
        'most'
    """

    policy: str
    """Minus the Gaussian."""
    endpoint: str
    """final or area."""
    higher: int
    """Robots on which the mean is higher."""
    found: int
    """Robots on which the difference is found higher: its interval, and the test after Holm's correction."""
    lower: int
    """Robots on which the difference is found lower."""
    there: int
    """Robots on which both cells are finished."""
    findable: int
    """Those of them on which the difference is found higher, or may be when the missing robots have arrived: they
    count as the last in Holm's correction until then."""

    @property
    def loose(self) -> str:
        """Whether the mean is higher on most robots: most, not most, or not yet known while cells are missing."""
        return self._most(self.higher, self.higher)

    @property
    def strict(self) -> str:
        """Whether the difference is found on most robots, in the same words."""
        return self._most(self.found, self.findable)

    def _most(self, count: int, possible: int) -> str:
        if count >= NEEDED:
            return "most"
        return "not yet known" if possible + len(ROBOTS) - self.there >= NEEDED else "not most"


def readings(outcomes: Outcomes, arm: str, endpoint: str = "final") -> list[Reading]:
    """Return both readings of the sentence for Beta and logit-normal, in this order.

    Args:
        outcomes: of the study.
        arm: printed or standard.
        endpoint: what is compared.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> [each.there for each in readings(Outcomes.read(StudyFolder()), "standard")]  # in the project's folder
        [6, 6]
    """
    found = []
    for policy in POLICIES:
        compared = list(
            analysis.differences(outcomes, Contrast(arm, "ppo", policy, "gaussian"), endpoint).values()
        )
        known = [each for each in compared if each.difference is not None]
        words = [verdict(each) for each in known]
        best = statistics.holm_at_best([each.p_value for each in compared])
        later = [verdict(replace(each, p_adjusted=float(p))) for each, p in zip(compared, best, strict=True)]
        higher = sum(float(each.difference.value) > 0 for each in known if each.difference is not None)
        found_higher, lower = words.count("higher"), words.count("lower")
        found.append(
            Reading(policy, endpoint, higher, found_higher, lower, len(known), later.count("higher"))
        )
    return found
