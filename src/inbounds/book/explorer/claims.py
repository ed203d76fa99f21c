"""The thesis's claims with their verdicts: a list that opens line by line, and buttons that choose what is shown.

    claims(study_pages.findings(study_pages.shipped()))

Everything stands in the HTML. `claims.js` hides lines and counts those it leaves; without it, and in print, all lines
are there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from inbounds.book.explorer.assets import carried_scripts, style_sheet
from inbounds.book.report import html
from inbounds.book.report.html import Shown
from inbounds.book.report.ledger_table import in_words
from inbounds.book.templates import macros
from inbounds.study.ledger import Finding
from inbounds.study.ledger.quotes import judged_anew, quote, verdict

ELEMENT = "inbounds-claims"
MARKS = {"supported": "✓", "refuted": "✗", "undecided": "?", "not tested": "–"}
"""Verdict → the sign beside its word."""
FEW = 8
"""So many claims need no buttons."""


def claims(found: Sequence[Finding]) -> Shown:
    """Return verdicts and claims, a line each, by subject; a line opens to the thesis's words, the test and its result.

    More than `FEW` have buttons, which choose by verdict, and a menu, which chooses by subject.

    Args:
        found: in the order of the page.

    Example:
        >>> claims([]), "No claim." in claims([]).html
        (<study: claims by subject>, True)
    """
    if not found:
        return html.of_study("claims by subject", html.missing("No claim."))
    subjects = {
        subject: [_line(each) for each in together]
        for subject, together in groupby(found, key=lambda each: each.claim.subject)
    }
    counts = Counter(map(verdict, found))
    element = macros("claims").element(
        subjects,
        {word: counts[word] for word in MARKS if counts[word]} if len(found) > FEW else {},
        MARKS,
        style_sheet(ELEMENT),
        carried_scripts(ELEMENT),
    )
    return html.of_study("claims by subject", str(element))


def _line(finding: Finding) -> dict[str, Any]:
    """Return what a claim's line shows, and what it opens to, as plain texts."""
    said = quote(finding.claim)
    return {
        "id": f"claim-{finding.claim.id}",
        "verdict": verdict(finding),
        "says": finding.claim.says,
        "words": said.words if said else "",
        "place": said.place if said else "",
        "test": finding.claim.test,
        "anew": judged_anew(finding),
        "told": in_words(finding.told).splitlines(),
        "counted": f"{finding.counted} ({finding.claim.standing})",
        "command": finding.claim.command,
    }


__all__ = ["FEW", "MARKS", "claims"]
