"""One meaning a letter: the notation page gives each letter one row, and rewritten pages use no retired one."""

import re
from pathlib import Path

import pytest

from tests.book import anatomy

PAGE = anatomy.ROOT / "book" / "notation.md"
RETIRED = {
    # how it was written once → how it is written now
    r"\\eta\(\\(?:theta|pi)": r"J(\theta)",
    r"(?<![A-Za-z\\])R\(a\)": "r(a)",
    r"(?<![A-Za-z\\])R_t\b": r"\hat G_t",
    r"(?<![A-Za-z\\])r_t\(\\theta\)": r"w_t(\theta)",
    r"(?<!\\mathcal )(?<!\\mathcal\{)(?<![A-Za-z\\])L(?:_\{\\text\{old|\^\{\\text\{CLIP)": r"\mathcal{L}",
    r"\\delta(?![_A-Za-z])": r"D_{\max}",
    r"(?<![A-Za-z\\])A\(\\eta": r"\Lambda(\eta)",
    r"\\langle\s*\\eta\s*,\s*T\b": "U(x)",
    r"(?<![A-Za-z\\])g\^1\b": r"\tilde\nabla J",
    r"\\tau(?:\(S\)|_0)": "C(S)",
    r"2\^\{-b\}": r"2^{-n_{\text{bits}}}",
}


def rows(page: str) -> list[tuple[str, str]]:
    """Symbol and meaning of each row of the table."""
    table = page.partition("```{list-table}")[2].partition("\n```")[0]
    found = [re.split(r"\n  - ", row) for row in re.split(r"^\* - ", table, flags=re.M)[2:]]
    return [(symbol, meaning) for symbol, meaning, _ in found]


def letters(symbols: str) -> set[str]:
    """The letters of a row: without accents, arguments and running indices; what a word marks is a letter of its own.

    `\\hat A_t` is `A`; `n_{\\text{eff}}` is not `n`; `\\Delta\\theta` is not `\\Delta`.
    """
    found = set()
    for formula in re.findall(r"\$([^$]+)\$", symbols):
        left = formula.partition("=")[0]
        left = re.sub(r"\\mid.*|\((?:[^()]|\([^()]*\))*\)", "", left)
        left = re.sub(r"\\(?:hat|bar|tilde)\s*(?:\{([^{}]*(?:\{[^{}]*\})?)\})?", r"\1", left)
        left = re.sub(r"[_^](?:\\\w+|\{(?!\\text)[^{}]*\}|[^\s{}\\])|\^\{\\text\{\w+\}\}|'", "", left)
        if r"\mathcal" in left or not re.search(r"_\{\\text\{(?:eff|bits)", left):
            left = re.sub(r"_\{\\text\{\w+\}\}", "", left)
        found.add(re.sub(r"\s", "", left))
    return found


def doubles(page: str) -> dict[str, list[str]]:
    """Letters with more than one row, and what these say."""
    meanings: dict[str, list[str]] = {}
    for symbols, meaning in rows(page):
        for letter in letters(symbols):
            meanings.setdefault(letter, []).append(meaning)
    return {letter: said for letter, said in meanings.items() if len(said) > 1}


def mathematics(prose: str) -> str:
    """The formulas of a text, a line each."""
    found = re.findall(r"\$\$(.+?)\$\$|\$([^$]+)\$|^```\{math\}(.*?)^```", prose, re.M | re.S)
    return "\n".join("".join(each) for each in found)


def test_each_letter_has_one_row() -> None:
    assert len(rows(PAGE.read_text(encoding="utf8"))) > 40
    assert doubles(PAGE.read_text(encoding="utf8")) == {}


def test_no_meaning_is_confined_to_a_chapter() -> None:
    for symbols, meaning in rows(PAGE.read_text(encoding="utf8")):
        assert "{doc}" not in meaning, symbols


@pytest.mark.parametrize("name", [*anatomy.REWRITTEN, *anatomy.PAGES.depth])
def test_rewritten_pages_use_no_retired_letter(name: str) -> None:
    formulas = mathematics(anatomy.prose_of(anatomy.ROOT / "notebooks" / f"{name}.ipynb"))
    for retired, now in RETIRED.items():
        assert re.findall(retired, formulas) == [], f"write {now}"


@pytest.mark.parametrize(
    ("symbols", "expected"),
    [
        (r"$A$, $\hat A_t$", {"A"}),
        (r"$\mathcal{A} = \prod_i [\ell_i, h_i]$", {r"\mathcal{A}"}),
        (r"$n_{\text{eff}}$, $n$", {r"n_{\text{eff}}", "n"}),
        (r"$\Delta\theta$; $\Delta = 2^{-3}$", {r"\Delta\theta", r"\Delta"}),
        (r"$\pi_\theta(a \mid s)$, $\rho^1(s)$, $\rho_\pi(s)$", {r"\pi", r"\rho"}),
        (
            r"$\mathcal{L}_{\text{old}}(\pi)$, $\hat{\mathcal{L}}$, $\mathcal{L}^{\text{CLIP}}$",
            {r"\mathcal{L}"},
        ),
        (r"$\bar D(\theta)$, $D_{\max}$, $D_f(p \,\|\, q)$", {"D"}),
    ],
)
def test_letters(symbols: str, expected: set[str]) -> None:
    assert letters(symbols) == expected


def test_a_second_meaning_is_noticed(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf8")
    row = "* - $\\hat A_i$\n  - the area of a circle\n  - –\n"
    assert "A" in doubles(page.replace("* - $W$\n", f"{row}* - $W$\n"))


@pytest.mark.parametrize(
    "written", [r"$\eta(\pi)$", r"$$r_t(\theta)$$", r"$L^{\text{CLIP}}$", r"$\le \delta$"]
)
def test_a_retired_letter_is_noticed(written: str) -> None:
    assert any(re.search(retired, mathematics(f"Here {written} stands.")) for retired in RETIRED)


@pytest.mark.parametrize(
    "written", [r"$J(\pi)$", r"$\delta_t$", r"$\mathcal{L}^{\text{CLIP}}$", r"$I(\eta)$", "$r_t$"]
)
def test_a_letter_in_use_is_left_alone(written: str) -> None:
    assert not any(re.search(retired, mathematics(f"Here {written} stands.")) for retired in RETIRED)
