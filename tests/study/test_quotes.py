"""The thesis is quoted word for word where its text is at hand; each row belongs to one tally."""

import re
from pathlib import Path

import pytest

from inbounds.study.ledger import CLAIMS, Finding
from inbounds.study.ledger.quotes import NOT_TESTED, QUOTES, quote, thesis_and_book, verdict

ROOT = Path(__file__).resolve().parents[2]
THESIS = ROOT.parent / "shared" / "source" / "thesis.txt"
RULE = (ROOT / "results" / "JUDGED-ANEW.md").read_text(encoding="utf8")


def bare(text: str) -> str:
    """Without spaces and hyphens, which the end of a line may add."""
    return re.sub(r"[\s-]+", "", text)


@pytest.mark.skipif(not THESIS.is_file(), reason="the thesis's text is not part of the repository")
@pytest.mark.parametrize("name", QUOTES)
def test_the_thesis_has_the_words(name: str) -> None:
    assert bare(QUOTES[name].words) in bare(THESIS.read_text(encoding="utf8"))


def test_each_row_belongs_to_one_tally() -> None:
    found = [Finding(claim, (), 0, 0) for claim in CLAIMS]
    thesis, book = thesis_and_book(found)
    assert len(thesis) + len(book) == len(CLAIMS)
    assert {each.claim.id for each in book} == {
        "start-noise",
        "start-raw",
        "cause-capg",
        "clip",
        "swimmer-gamma",
        "swimmer-order",
    }
    assert all(
        quote(each.claim).place in ("section 2.3", *(f"chapter {k}" for k in range(1, 8))) for each in thesis
    )


def test_every_quote_is_used() -> None:
    used = {name for name in QUOTES for claim in CLAIMS if quote(claim) is QUOTES[name]}
    assert used == set(QUOTES)


def test_what_is_not_tested_is_named_by_the_rule() -> None:
    for claim in CLAIMS:
        if claim.id in NOT_TESTED:
            assert f"`{claim.id}`" in RULE
            assert verdict(Finding(claim, (), 0, 0)) == "not tested"
