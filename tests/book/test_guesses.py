"""The questions of a Predict box become forms whose key comes from the answer; what does not add up stops the build."""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest
from docutils import nodes

from tests.book import small_book
from tests.book.anatomy import REWRITTEN, block, prose_of

ROOT = Path(__file__).resolve().parents[2]

CHOICE = """```{guess}
Is $x$ **more** or less?

- (a) more, $x > 1$
- (b) less
- (c) $x = 1$
```
"""
NUMBER = """```{guess}
:truth: share
:unit: %
:range: 0 100
:within: 5

In what share of the steps?
```
"""
SEVERAL = """```{guess}
:several:

Which of these change?

- (a) mean
- (b) ratio
- (c) entropy
```
"""
ANSWER = """```{dropdown} Answer
1. **(b)** Less.
   - (a) Only if $x$ grew.
   - (c) A constant matters.
2. It is {glue:text}`share:.0%`.
3. **(a, c)** Both.
```
"""
BOX = f"Some words first.\n\n{CHOICE}\n{NUMBER}\n{SEVERAL}\n{ANSWER}"
ALONE = f"{CHOICE}\n```{{dropdown}} Answer\n**(b)** Less.\n\n- (a) Only if so.\n- (c) It matters.\n```"


def built(folder: Path, box: str, share: str = "0.553", kind: str = "predict") -> tuple[str, str]:
    """A page with one box, built; its HTML, and what the build complained of."""
    cell = nbformat.v4.new_code_cell("glue('share', 0.553, display=False)", execution_count=1)
    shown = nbformat.v4.new_output("display_data", data={"text/plain": share})
    shown.metadata = {"scrapbook": {"name": "share"}}
    cell.outputs = [shown]
    page = nbformat.v4.new_markdown_cell(
        f"# A page\n\n````{{admonition}} Predict\n:class: {kind}\n\n{box}\n````"
    )
    notebook = nbformat.v4.new_notebook(
        cells=[page, cell], metadata={"language_info": {"name": "python", "pygments_lexer": "ipython3"}}
    )
    nbformat.write(notebook, folder / "index.ipynb")
    settings = {
        "extensions": ["myst_nb", "sphinx_design", "guesses"],
        "myst_enable_extensions": ["dollarmath", "tasklist"],
        "html_static_path": [str(ROOT / "book" / "_static")],
    }
    said = small_book.build(folder, settings)
    return (folder / "html" / "index.html").read_text(encoding="utf8"), said


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    html, said = built(tmp_path_factory.mktemp("book"), BOX)
    assert said == ""
    return html


def test_a_question_is_a_group_with_a_name(page: str) -> None:
    assert page.count("<fieldset>") == page.count("</fieldset>") == 3
    legends = re.findall(r"<legend>(.*?)</legend>", page, re.S)
    assert [legend[:3] for legend in legends] == ["1. ", "2. ", "3. "]
    assert "<strong>more</strong>" in legends[0]
    assert "math" in legends[0]
    assert page.count('role="status"') == 4  # three results and the tally
    assert page.count('class="guess-check"') == 1


def test_options_are_labelled_and_say_their_letters(page: str) -> None:
    radios = re.findall(r'<label><input name="([^"]+)" type="radio" value="(.)">', page)
    assert [letter for _, letter in radios] == ["a", "b", "c"]
    assert len({name for name, _ in radios}) == 1
    assert re.findall(r'<label><input [^>]*type="checkbox" value="(.)">', page) == ["a", "b", "c"]
    assert "(b) <" not in page
    assert page.count("(b) less") == 1
    assert "(b) ratio" in page


def test_keys_come_from_the_answer(page: str) -> None:
    assert re.findall(r'data-kind="(\w+)"', page) == ["choice", "number", "several"]
    assert re.findall(r'data-right="(\w+)"', page) == ["b", "ac"]
    (name,) = re.findall(r'data-kind="choice" data-name="([\w-]+)"', page)
    assert re.search(rf'<li class="guess-why-{name}-a">\s*<p>\(a\) Only if', page)
    assert f"guess-why-{name}-c" in page
    assert f"guess-why-{name}-b" not in page


def test_a_number_is_compared_with_what_the_notebook_glues(page: str) -> None:
    (form,) = re.findall(r'<div class="inbounds-guess"[^>]*data-kind="number"[^>]*>', page)
    assert re.search(r'data-truth="55\.3\d*"', form)
    assert 'data-shown="55.3"' in form
    assert 'data-within="5"' in form
    assert re.search(r'<input [^>]*max="100" min="0" [^>]*type="range"', page)
    before_the_fold = re.sub(r"<[^>]+>", "", page[page.index("<fieldset>") : page.index("guess-actions")])
    assert "55" not in before_the_fold


def test_scripts_come_with_the_questions_only(tmp_path: Path, page: str) -> None:
    assert 'src="_static/guesses.js' in page
    assert "_static/guesses.css" in page
    plain, _ = built(tmp_path, "A question without a form.")
    assert "guesses" not in plain


def test_a_lone_question_needs_no_numbered_list(tmp_path: Path) -> None:
    html, said = built(tmp_path, ALONE)
    assert said == ""
    assert "<legend>Is" in html
    assert 'data-right="b"' in html
    assert html.count("guess-why-") == 2


def without(text: str) -> Callable[[str], str]:
    return lambda box: box.replace(text, "")


def instead(text: str, other: str) -> Callable[[str], str]:
    return lambda box: box.replace(text, other)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (instead("**(b)** Less", "**(d)** Less"), "answer 1 calls (d) right, which is no option"),
        (instead("**(b)** Less", "Less"), "answer 1 does not begin with its key"),
        (instead("**(b)** Less", "**(a, b)** Less"), "needs :several:"),
        (without("   - (c) A constant matters.\n"), "answer 1 does not say why (c) is wrong"),
        (instead("- (a) Only", "- (e) Only"), "(e) twice, or it is no option"),
        (without("3. **(a, c)** Both.\n"), "3 questions, and a numbered list of 2 answers"),
        (instead("{dropdown} Answer", "{note}"), "in one {dropdown}"),
        (instead("- (b) less\n", "- (d) less\n"), "in order, two at least, and not a, d, c"),
        (instead("- (b) less\n", "- less\n"), "does not begin with a letter"),
        (without("- (a) more, $x > 1$\n- (b) less\n- (c) $x = 1$\n"), "one list of its options"),
        (instead(":truth: share", ":truth: shore"), "no cell glues its :truth:, 'shore'"),
        (instead(":range: 0 100", ":range: 60 100"), "55.3, lies outside its :range:"),
        (instead(":range: 0 100", ":range: 100 0"), ":range: is two numbers"),
        (instead(":range: 0 100", ":step: 1"), "a :step: is that of the slider"),
        (instead(":within: 5", ":within: close"), ":within: is a distance"),
        (instead(":within: 5", ":within: x1"), "has to be above 1"),
        (without(":truth: share\n"), "without :truth: nothing is compared"),
        (instead("{guess}\nIs $x$", "{guess}\n- Is $x$"), "begins with its question"),
    ],
)
def test_what_does_not_add_up_is_an_error(
    tmp_path: Path, change: Callable[[str], str], complaint: str
) -> None:
    changed = change(BOX)
    assert changed != BOX
    _, said = built(tmp_path, changed)
    assert "ERROR" in said
    assert complaint in re.sub(r"\x1b\[[\d;]*m", "", said)


def test_a_truth_that_is_no_number_is_an_error(tmp_path: Path) -> None:
    _, said = built(tmp_path, BOX.replace(" {glue:text}`share:.0%`", " so"), share="'a lot'")
    assert "is no number: 'a lot'" in said


@pytest.mark.parametrize("share", ["'55.3% [50%, 60%]'", "0.553", "5.53e-1"])
def test_a_truth_may_stand_before_its_interval(tmp_path: Path, share: str) -> None:
    html, said = built(tmp_path, BOX.replace(" {glue:text}`share:.0%`", " so"), share=share)
    assert said == ""
    assert 'data-shown="55.3"' in html


def test_a_guess_outside_a_box_is_an_error(tmp_path: Path) -> None:
    _, said = built(tmp_path, BOX, kind="note")
    assert "outside an admonition of class predict" in said


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (55.3, "55.3"),
        (0.0499, "0.05"),
        (7.0, "7"),
        (1234.5, "1\N{NARROW NO-BREAK SPACE}234"),
        (-3.14159, "−3.14"),
        (0.25, "0.25"),
    ],
)
def test_numbers_are_shown_with_three_digits(number: float, text: str) -> None:
    sys.path.insert(0, str(small_book.EXTENSIONS))
    try:
        import guesses
    finally:
        sys.path.remove(str(small_book.EXTENSIONS))
    assert guesses.shown(number) == text
    assert isinstance(guesses.element("p"), nodes.Element)


def told_before(prose: str) -> set[str]:
    """The truths that a reader has already read where the page asks for them."""
    box = block(prose, "Predict")
    above = prose[: prose.index(box)] + box.split("{dropdown} Answer")[0]
    return {
        truth
        for truth in re.findall(r"^:truth: (\S+)$", box, re.M)
        if re.search(rf"\{{glue(?::\w+)?\}}`{re.escape(truth)}[:`]", above)
    }


@pytest.mark.parametrize("chapter", REWRITTEN)
def test_no_number_is_told_before_it_is_asked_for(chapter: str) -> None:
    assert told_before(prose_of(ROOT / "notebooks" / f"{chapter}.ipynb")) == set()


@pytest.mark.parametrize("said", ["{glue:text}`share:.0%`", "{glue:text}`share`", "{glue}`share`"])
def test_a_number_that_is_told_before_it_is_asked_for_is_seen(said: str) -> None:
    page = f"- It is SAID.\n\n````{{admonition}} Predict\n:class: predict\n\n{BOX}\n````"
    assert told_before(page.replace("SAID", said)) == {"share"}
    assert told_before(page.replace("SAID", "{glue:text}`share-of-others:.0%`")) == set()
