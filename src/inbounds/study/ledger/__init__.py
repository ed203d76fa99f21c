"""The claims of the source thesis, and what the study says to each.

`verdicts` has the rule, `evidence` and `computed` what decides, `claims_on_results` and `claims_on_reasons` the claims.

>>> from inbounds.study.outcomes import Outcomes
>>> from inbounds.study.store import StudyFolder
>>> from pathlib import Path
>>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
>>> judge(nothing, *claims_named(["wins-ppo-printed"])).verdict
'undecided'
"""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.study.ledger.claims_on_reasons import CAUSES, PARTS, TRUST
from inbounds.study.ledger.claims_on_results import STARTS, SWIMMER, WINS
from inbounds.study.ledger.verdicts import Claim, Finding, Statement, count, judge, possible_verdicts

__all__ = ["CLAIMS", "Claim", "Finding", "Statement", "claims_named", "count", "judge", "possible_verdicts"]

CLAIMS = (*STARTS, *WINS, *CAUSES, *PARTS, *SWIMMER, *TRUST)
"""All claims, in the order of the page."""


def claims_named(names: Sequence[str] = ()) -> tuple[Claim, ...]:
    """Return the claims of some names, all of them for none.

    Raises:
        ValueError: there is no such claim.

    Example:
        >>> [claim.id for claim in claims_named(["kl", "clip"])]
        ['clip', 'kl']
    """
    names = (names,) if isinstance(names, str) else names
    known = [claim.id for claim in CLAIMS]
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"no claim {', '.join(unknown)}; there are {', '.join(known)}")
    return tuple(claim for claim in CLAIMS if not names or claim.id in names)
