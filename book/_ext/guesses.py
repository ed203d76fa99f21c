"""Questions of a *Predict* box that take a guess and score it: the directive ``{guess}``, and ``guesses.js``.

* A choice is a question and a list of lettered options, ``- (a) text``; with ``:several:`` any number may hold.
* A number names what the notebook glues: ``:truth: name``, ``:within: 5`` (or ``x1.5``, a factor), and perhaps
  ``:unit: %`` (the truth is then a share), ``:range: 0 100`` (a slider) and ``:step: 1``.
* The key stands in the box's ``{dropdown}``, whose numbered list answers question by question: ``1. **(b)** Less, …``.
  A list below it, ``- (a) …``, says why each other option is wrong. A lone question needs no numbered list.

Without scripts a box reads as its source does: question, options, answer in a fold. A box that does not add up, or
a truth that no cell glues, is an error of the build.
"""

import re
import zlib
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from myst_nb.core.variables import RetrievalError
from myst_nb.ext.glue.utils import retrieve_glue_data
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

GUESS = 'class="inbounds-guess"'
OPTION = re.compile(r"\(([a-z])\) +")
KEY = re.compile(r"\(([a-z](?:, [a-z])*)\)")
WITHIN = re.compile(r"x?\d+(?:\.\d+)?")
TOLD = re.compile(
    r"'?([−-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?)(%?)(?![\w.])"
)  # a number, or a text that begins with one
LETTERS = "abcdefghijklmnopqrstuvwxyz"
SPACE = "\N{NARROW NO-BREAK SPACE}"
CHECK = "Check my guess"
LOG = logging.getLogger(__name__)


class tagged(nodes.General, nodes.Element):  # noqa: N801  (nodes of docutils are written so)
    """An element of HTML: ``tag`` and ``attributes``. Other builders show what is in it."""


def element(tag: str, *children: nodes.Node, **attributes: str) -> tagged:
    """Return an element; ``class_`` and ``for_`` lose their underscore, other underscores become hyphens."""
    named = {name.rstrip("_").replace("_", "-"): value for name, value in attributes.items()}
    return tagged("", *children, tag=tag, attributes=named)


def open_tag(translator: Any, node: tagged) -> None:
    """Write an element's beginning."""
    translator.body.append(translator.starttag(node, node["tag"], "", **node["attributes"]))


def close_tag(translator: Any, node: tagged) -> None:
    """Write an element's end, if it has one."""
    if node["tag"] != "input":
        translator.body.append(f"</{node['tag']}>")


def nothing(translator: Any, node: tagged) -> None:
    """What builders without HTML write."""


class Guess(SphinxDirective):
    """One question: its text, and its options or what its number is compared with."""

    has_content = True
    option_spec: ClassVar = {
        "truth": directives.unchanged_required,
        "within": directives.unchanged_required,
        "unit": directives.unchanged_required,
        "range": directives.unchanged_required,
        "step": directives.unchanged_required,
        "several": directives.flag,
    }

    def run(self) -> list[nodes.Node]:
        """Return the form of the question; its key is put in once the answer is read."""
        inside = nodes.container()
        self.state.nested_parse(self.content, self.content_offset, inside)
        try:
            return [self.form(inside)]
        except ValueError as error:
            raise self.error(f"guess: {error}") from None

    def form(self, inside: nodes.container) -> tagged:
        """Return the question's element."""
        question = inside.children[0] if inside.children else None
        if not isinstance(question, nodes.paragraph):
            raise ValueError(
                "it begins with its question, one paragraph; what that needs stands before the directive"
            )
        name = f"{self.env.docname.rpartition('/')[2]}-{zlib.crc32(inside.astext().encode()):08x}"
        legend = element("legend", *question.children)
        data = {"data_name": name}
        if "truth" in self.options:
            if len(inside.children) != 1:
                raise ValueError("a question with a :truth: has no options")
            answer, more = self.number()
            letters = ""
        else:
            if unused := set(self.options) - {"several"}:
                raise ValueError(f"without :truth: nothing is compared: {', '.join(sorted(unused))}")
            letters, answer = choices(inside.children[1:], name, several="several" in self.options)
            more = {"data_kind": "several" if "several" in self.options else "choice"}
        result = element("p", class_="guess-result", role="status")
        field = element("fieldset", legend, answer, result)
        return tagged(
            "",
            field,
            tag="div",
            attributes={"class": "inbounds-guess", **hyphened(data | more)},
            letters=letters,
        )

    def number(self) -> tuple[tagged, dict[str, str]]:
        """Return what takes a number, and what the number is compared with."""
        unit, within = self.options.get("unit", ""), self.options.get("within", "")
        if not WITHIN.fullmatch(within):
            raise ValueError(f":within: is a distance like 5, or a factor like x1.5, and not {within!r}")
        truth = self.truth() * (100 if unit == "%" else 1)
        if within.startswith("x") and (truth <= 0 or float(within[1:]) <= 1):
            raise ValueError(
                f"a factor like {within} needs a truth above 0 ({truth:g}) and has to be above 1"
            )
        if "step" in self.options and "range" not in self.options:
            raise ValueError("a :step: is that of the slider, which needs a :range:")
        field = element("input", type="text", autocomplete="off")
        children: list[nodes.Node] = [field]
        if within.startswith("x") or not self.options.get("range", "-").startswith("-"):
            field["attributes"]["inputmode"] = (
                "decimal"  # a phone's keys for digits, which have no minus sign
            )
        if "range" in self.options:
            low, high = limits(self.options["range"])
            if not low <= truth <= high:
                raise ValueError(f"the truth, {truth:g}, lies outside its :range:, {low:g} to {high:g}")
            step = self.options.get("step", f"{(high - low) / 100:g}")
            slider = {"min": f"{low:g}", "max": f"{high:g}", "step": step, "value": f"{(low + high) / 2:g}"}
            children.insert(0, element("input", type="range", aria_label="Your guess, as a slider", **slider))
        near = f"within a factor of {within[1:]}" if within.startswith("x") else f"within {within}"
        label = element("span", nodes.Text("Your guess "), class_="guess-label")
        after = f"{SPACE}{unit} " if unit else " "
        hint = element("span", nodes.Text(f"({near} counts as right)"), class_="guess-hint")
        number = element("label", label, children.pop(), nodes.Text(after))
        data = {"data_kind": "number", "data_truth": repr(truth), "data_within": within, "data_unit": unit}
        return element("div", *children, number, hint, class_="guess-number"), data | {
            "data_shown": shown(truth)
        }

    def truth(self) -> float:
        """Return the number that the notebook glues."""
        name = self.options["truth"]
        try:
            text = retrieve_glue_data(self.state.document, name).data["text/plain"]
        except (RetrievalError, KeyError):
            raise ValueError(f"no cell glues its :truth:, {name!r}") from None
        if not (found := TOLD.match(text)):
            raise ValueError(f"its :truth:, {name!r}, is no number: {text[:40]}")
        return float(found[1].replace(",", "").replace("\N{MINUS SIGN}", "-")) / (100 if found[2] else 1)


def hyphened(data: dict[str, str]) -> dict[str, str]:
    """Return attributes as HTML writes them."""
    return {name.replace("_", "-"): value for name, value in data.items()}


def limits(text: str) -> tuple[float, float]:
    """Return the two numbers of ``:range:``."""
    try:
        low, high = map(float, text.split())
    except ValueError:
        low, high = 0.0, 0.0
    if not low < high:
        raise ValueError(f":range: is two numbers, the smaller first, and not {text!r}")
    return low, high


def shown(number: float) -> str:
    """Return a number with three digits that say something, as the prose sets it."""
    decimals = max(0, 3 - len(str(int(abs(number))))) if abs(number) >= 1 else 3
    text = f"{number:,.{decimals}f}".replace(",", SPACE).replace("-", "\N{MINUS SIGN}")
    return text.rstrip("0").rstrip(".") if "." in text else text


def choices(found: list[nodes.Node], name: str, *, several: bool) -> tuple[str, tagged]:
    """Return the letters of a question's options, and the list of them."""
    if len(found) != 1 or not isinstance(found[0], nodes.bullet_list):
        raise ValueError(
            "behind the question comes one list of its options, `- (a) text`, or it has a :truth:"
        )
    letters, items = "", []
    for item in found[0].children:
        letter, paragraph = lettered(item)
        if len(item.children) != 1:
            raise ValueError(f"option ({letter}) is one paragraph")
        letters += letter
        field = element("input", type="checkbox" if several else "radio", name=name, value=letter)
        text = element("span", nodes.Text(f"({letter}) "), *paragraph.children)
        items.append(element("li", element("label", field, text)))
    if letters != LETTERS[: len(letters)] or len(letters) < 2:
        raise ValueError(f"its options are (a), (b), … in order, two at least, and not {', '.join(letters)}")
    return letters, element("ul", *items, class_="guess-options")


def lettered(item: nodes.Node) -> tuple[str, nodes.paragraph]:
    """Return the letter of an item of a list, and its first paragraph without it."""
    paragraph = item.children[0] if item.children else None
    first = paragraph.children[0] if isinstance(paragraph, nodes.paragraph) else None
    found = OPTION.match(first.astext()) if isinstance(first, nodes.Text) else None
    if not found:
        raise ValueError(f"`{item.astext()[:30]}` does not begin with a letter, `(a) text`")
    rest = paragraph.deepcopy()
    rest[0] = nodes.Text(first.astext()[found.end() :])
    return found[1], rest


def put_keys_in(app: Sphinx, doctree: nodes.document) -> None:
    """Give each question of a page its key and its reasons, and each box its button."""
    done = set()
    for box in doctree.findall(lambda node: isinstance(node, nodes.Element) and "predict" in node["classes"]):
        guesses = [
            node for node in box.findall(tagged) if node["attributes"].get("class") == "inbounds-guess"
        ]
        if not guesses:
            continue
        done.update(map(id, guesses))
        try:
            finish(box, guesses)
        except ValueError as error:
            LOG.error("Predict: %s", error, location=box)
    for node in doctree.findall(tagged):
        if node["attributes"].get("class") == "inbounds-guess" and id(node) not in done:
            LOG.error("Predict: a guess stands outside an admonition of class predict", location=node.parent)


def finish(box: nodes.Element, guesses: list[tagged]) -> None:
    """Read the answer of a box, and put the button behind the last question."""
    folds = [node for node in box.children if node.get("design_component") == "dropdown"]
    if len(folds) != 1:
        raise ValueError("the answer stands in one {dropdown} behind the questions")
    lists = [node for node in folds[0].children if isinstance(node, nodes.enumerated_list)]
    answers = lists[0].children if lists else folds[:1]
    if len(answers) != len(guesses):
        raise ValueError(f"{len(guesses)} questions, and a numbered list of {len(answers)} answers")
    for number, (guess, answer) in enumerate(zip(guesses, answers, strict=True), start=1):
        if guess["letters"]:
            key(number, guess, answer)
        if len(guesses) > 1:
            guess[0][0].insert(0, nodes.Text(f"{number}. "))
    button = element("button", nodes.Text(CHECK), type="button", class_="guess-check")
    tally = element("p", class_="guess-tally", role="status")
    box.insert(box.index(folds[0]), element("div", button, tally, class_="guess-actions"))


def key(number: int, guess: tagged, answer: nodes.Element) -> None:
    """Put what the answer says is right into a question, and mark the reasons."""
    told = next((node for node in answer.findall(nodes.strong)), None)
    found = KEY.fullmatch(told.astext()) if told is not None else None
    if not found:
        raise ValueError(f"answer {number} does not begin with its key, `**(b)**`")
    right = found[1].replace(", ", "")
    if unknown := set(right) - set(guess["letters"]):
        raise ValueError(f"answer {number} calls ({', '.join(sorted(unknown))}) right, which is no option")
    several = guess["attributes"]["data-kind"] == "several"
    if len(right) > 1 and not several:
        raise ValueError(f"answer {number} has {len(right)} right options: the question needs :several:")
    guess["attributes"]["data-right"] = right
    reasons = ""
    for item in (
        item for node in answer.children if isinstance(node, nodes.bullet_list) for item in node.children
    ):
        letter, _ = lettered(item)
        if letter in reasons or letter not in guess["letters"]:
            raise ValueError(f"answer {number} gives a reason for ({letter}) twice, or it is no option")
        reasons += letter
        item["classes"].append(f"guess-why-{guess['attributes']['data-name']}-{letter}")
    if not several and (silent := sorted(set(guess["letters"]) - set(right) - set(reasons))):
        raise ValueError(f"answer {number} does not say why ({', '.join(silent)}) is wrong")


def load_script(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Load what scores the guesses, on the pages that have some."""
    if GUESS in context.get("body", ""):
        app.add_css_file("guesses.css")
        app.add_js_file("guesses.js", loading_method="defer")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register node, directive and handlers (called by Sphinx)."""
    silent = (nothing, nothing)
    app.add_node(tagged, html=(open_tag, close_tag), latex=silent, text=silent, man=silent, texinfo=silent)
    app.add_directive("guess", Guess)
    app.connect("doctree-read", put_keys_in)
    app.connect("html-page-context", load_script)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
