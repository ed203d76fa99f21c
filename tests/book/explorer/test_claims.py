"""The claims to choose from: every claim with its verdict in a word and a sign, its words, numbers and place."""

import re
from html import unescape

import pytest

from inbounds.book.explorer.assets import style_sheet
from inbounds.book.explorer.claims import ELEMENT, FEW, MARKS, claims
from inbounds.book.report import study_pages
from inbounds.book.report.ledger_table import in_words
from inbounds.study.ledger import CLAIMS, Finding, judge
from inbounds.study.ledger.quotes import quote, verdict
from inbounds.study.ledger.verdicts import Verdict
from tests.book.colour_vision import GROUNDS, contrast

CHEAP = ("beta-hessian", "centres")  # of those that are computed on the spot


@pytest.fixture(scope="module")
def found() -> list[Finding]:
    outcomes = study_pages.shipped()
    return [judge(outcomes, claim) for claim in CLAIMS if claim.cells or claim.id in CHEAP]


def lines_of(page: str) -> list[str]:
    return unescape(page).split("<details ")[1:]


def test_each_claim_opens_to_the_words_of_the_thesis(found: list[Finding]) -> None:
    """A line a claim with its verdict; below it the quotation with its place, the test, and each statement."""
    page = claims(found).html
    lines = lines_of(page)
    assert len(lines) == len(found) > FEW
    for line, each in zip(lines, found, strict=True):
        word = verdict(each)
        assert line.startswith(f'id="claim-{each.claim.id}" data-verdict="{word}">')
        badge, _, rest = line.partition("</b>")
        assert badge.endswith(f'aria-hidden="true">{MARKS[word]}</span> {word.capitalize()}')
        assert rest.startswith(f" <span>{each.claim.says}</span></summary>")
        said = quote(each.claim)
        if said is None:
            assert "<blockquote>" not in rest
        else:
            assert f"<blockquote>“{said.words}” ({said.place})</blockquote>" in rest
        assert all(f"<li>{told}</li>" in rest for told in in_words(each.told).splitlines())
        assert each.claim.test in rest
        assert each.counted in rest
        assert f"<code>{each.claim.command}</code>" in rest
    assert re.findall(r"<h3>(.*?)</h3>", unescape(page)) == list(
        dict.fromkeys(each.claim.subject for each in found)
    )


def test_the_buttons_count_what_is_there(found: list[Finding]) -> None:
    page = claims(found).html
    buttons = re.findall(
        r'<button type="button" data-verdict="(.*?)" aria-pressed="(.*?)">.*? <span>(\d+)</span></button>',
        page,
    )
    words = [verdict(each) for each in found]
    expected = [("", "true", str(len(found)))]
    expected += [(word, "false", str(words.count(word))) for word in MARKS if word in words]
    assert buttons == expected
    assert f'aria-live="polite">{len(found)} of {len(found)} claims.' in page
    assert page.count("<option>") == len({each.claim.subject for each in found})
    assert "<button" not in claims(found[:FEW]).html
    assert len(lines_of(claims(found[:FEW]).html)) == FEW


def test_every_verdict_has_a_sign_and_a_look_of_its_own() -> None:
    """The sign and the border say it to who sees no colours; the colour is dark or light enough for small text."""
    words = [*Verdict.__args__, "not tested"]
    assert list(MARKS) == words
    assert len(set(MARKS.values())) == len(words)
    style = style_sheet(ELEMENT)
    for word in words:
        assert f'[data-verdict="{word}"]' in style
        name = word.replace(" ", "-")
        colours = re.findall(rf"--{name}: (#[0-9a-f]{{6}})", style)
        for colour, ground in zip(colours, GROUNDS.values(), strict=True):
            assert contrast(colour, ground) >= 7
    borders = [re.search(rf'\[data-verdict="{word}"\] {{(.*?)}}', style)[1] for word in words]  # type: ignore[index]
    assert len({re.sub(r"color: var\(.*?\);", "", border).strip() for border in borders}) == len(words)


def test_the_script_comes_along_where_no_book_brings_it(
    found: list[Finding], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("INBOUNDS_BOOK_BUILD", raising=False)
    assert "addEventListener" in claims(found).html
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    assert "<script" not in claims(found).html
