"""The claims of the source thesis in the study's report: one table, every number from the finished cells."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from inbounds.book.report import html
from inbounds.book.report.html import Shown
from inbounds.book.report.study_figures import SHORT
from inbounds.book.report.words import change_name
from inbounds.study.cell import VARIANTS
from inbounds.study.ledger import CLAIMS, Finding, judge
from inbounds.study.ledger.quotes import judged_anew, quote, thesis_and_book, verdict
from inbounds.study.ledger.verdicts import STAYS
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics.settings import LEVEL
from inbounds.study.words import percent

HEAD = ("claim", "verdict, test and result")
TIMED = "fisher-time"
"""The claim whose intervals are over repeats of a measurement, not over seeds."""
_NAMES: Mapping[str, str] = {**SHORT, **{name: change_name(name) for name in VARIANTS if name}}
"""Family or variant → what the table calls it."""
_NAMED = re.compile(
    rf"(?<![\w-])({'|'.join(map(re.escape, sorted(_NAMES, key=len, reverse=True)))})(?![\w-])"
)


def findings(outcomes: Outcomes) -> list[Finding]:
    """Return the judgement of every claim of the source thesis."""
    return [judge(outcomes, claim) for claim in CLAIMS]


def ledger(found: Sequence[Finding]) -> Shown:
    """Return the count of verdicts and the table of claims.

    Args:
        found: in the order of the table.
    """
    rows = [
        [
            f"{_words(each)}{each.claim.says}\n({each.claim.where})\n`{each.claim.command}`",
            f"{verdict(each).upper()}\n{_why_not(each)}{each.counted}\ncells: {each.cells}; {each.claim.standing}\n"
            f"Test: {each.claim.test}\n{in_words(each.told)}",
        ]
        for each in found
    ]
    claims = html.with_code(html.table(_caption(found), HEAD, rows, words=range(len(HEAD))))
    thesis, book = thesis_and_book(found)
    tallies = [
        html.paragraph(f"{whose}: {counted(part)}")
        for whose, part in (("The thesis's claims", thesis), ("This book's own", book))
        if part
    ]
    return html.of_study("the ledger", *tallies, claims)


def in_words(told: str) -> str:
    """Return what a claim's statements say, with the families' labels and the changed settings in words.

    Example:
        >>> in_words("Hopper, PPO, logit-normal − gaussian, printed-clip: 3.0 [2.7, 3.6] (for)")
        'Hopper, PPO, Logit-normal − Gaussian, printed clip: 3.0 [2.7, 3.6] (for)'
    """
    return _NAMED.sub(lambda name: _NAMES[name[0]], told)


def _caption(found: Sequence[Finding]) -> str:
    """Return the table's caption, which speaks of repeats only where a row has them."""
    timed = f", of {TIMED} over ten repeats" if any(each.claim.id == TIMED for each in found) else ""
    return (
        f"Claims, with what is for and against them. In brackets {percent(LEVEL)} bootstrap intervals over seeds"
        f"{timed}; p of a permutation test, corrected over the six robots (Holm). Open: the interval leaves both "
        "possible, or, not after Holm, the test does not find what it shows. Moot: there is nothing to explain. "
        "Exploratory: the protocol does not list such a number. Stays undecided: no missing cell can decide it."
    )


def _words(finding: Finding) -> str:
    """Return the thesis's own words with their place, as a line; nothing for a row of this book's own."""
    said = quote(finding.claim)
    return f"“{said.words}” ({said.place})\n" if said else ""


def _why_not(finding: Finding) -> str:
    """Return why a row does not test the thesis's sentence, as a line; nothing where it does."""
    anew = judged_anew(finding)
    return f"Judged anew: {anew}\n" if anew else ""


def counted(found: Sequence[Finding]) -> str:
    """Return how many claims have which verdict.

    Example:
        >>> counted([])
        '0 claims: 0 supported, 0 refuted, 0 undecided.'
    """
    verdicts = Counter(map(verdict, found))
    words = ("supported", "refuted", "undecided", *(["not tested"] if verdicts["not tested"] else []))
    told = ", ".join(f"{verdicts[word]} {word}" for word in words)
    stay = sum(each.outlook == STAYS for each in found if verdict(each) == "undecided")
    rest = (
        f"; {stay} of the undecided cannot be decided by the cells that are still to be run" if stay else ""
    )
    return f"{len(found)} claim{'' if len(found) == 1 else 's'}: {told}{rest}."


def decided(found: Sequence[Finding]) -> Shown:
    """Return the claims that are decided, as a list without their numbers; a paragraph where none is."""
    parts = []
    for word in ("supported", "refuted"):
        if told := [each.claim.says for each in found if verdict(each) == word]:
            parts += [html.paragraph(f"{word.capitalize()}:"), html.bullets(told)]
    return html.of_study("what is decided", *(parts or [html.missing("No claim is decided yet.")]))
