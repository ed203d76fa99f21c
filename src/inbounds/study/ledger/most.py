"""One sentence of the thesis about two policies, read in the same way for both (rule 4 of `results/JUDGED-ANEW.md`).

Its chapter 5 says that Beta and logit-normal "tended to surpass Gaussian policy in most of the environments"
(`inbounds.study.ledger.quotes.MOST`). The words allow two readings. *Loose*: the mean is higher. *Strict*: the
difference is found. Both are counted for both policies, and "most" is the same number for all.
"""

from __future__ import annotations

from dataclasses import dataclass

from inbounds.study import analysis
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
        >>> Reading("beta", "final", higher=5, found=4, lower=0, there=6).strict
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

    @property
    def loose(self) -> str:
        """Whether the mean is higher on most robots: most, not most, or not yet known while cells are missing."""
        return self._most(self.higher)

    @property
    def strict(self) -> str:
        """Whether the difference is found on most robots, in the same words."""
        return self._most(self.found)

    def _most(self, count: int) -> str:
        if count >= NEEDED:
            return "most"
        return "not yet known" if count + len(ROBOTS) - self.there >= NEEDED else "not most"


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
        compared = analysis.differences(outcomes, Contrast(arm, "ppo", policy, "gaussian"), endpoint).values()
        known = [each for each in compared if each.difference is not None]
        words = [verdict(each) for each in known]
        higher = sum(float(each.difference.value) > 0 for each in known if each.difference is not None)
        found.append(
            Reading(policy, endpoint, higher, words.count("higher"), words.count("lower"), len(known))
        )
    return found
