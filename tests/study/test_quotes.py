"""Quotes of the thesis can be compared with its text; each row belongs to one tally."""

import subprocess
import sys
from pathlib import Path

from inbounds.study.ledger import CLAIMS, Finding
from inbounds.study.ledger.quotes import ALL, NOT_TESTED, QUOTES, not_in, quote, thesis_and_book, verdict

ROOT = Path(__file__).resolve().parents[2]
RULE = (ROOT / "results" / "JUDGED-ANEW.md").read_text(encoding="utf8")


def test_quotes_are_looked_for_word_by_word(tmp_path: Path) -> None:
    """In a made-up text of all quotes with an ending line after every third word, and in one that lacks a word."""
    words = [word for each in ALL.values() for word in each.words.split()]
    text = " ".join(word + "\n" * (k % 3 == 0) for k, word in enumerate(words))
    assert not_in(text) == []
    name = "start"
    lost = QUOTES[name].words.split()[3]
    assert name in not_in(text.replace(lost, "", 1))
    for whole, code in ((text, 0), ("", 1)):
        (tmp_path / "thesis.txt").write_text(whole, encoding="utf8")
        command = [sys.executable, "-m", "inbounds.study.ledger.quotes", str(tmp_path / "thesis.txt")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        assert (f"all {len(ALL)} quotes are in the text" in done.stdout) == (code == 0)


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
