"""The grader of what is within reach passes the package's own answer, and names the known mistakes."""

from collections.abc import Callable, Sequence

import pytest

from inbounds.book.exercises import claim_by_claim as graders
from inbounds.study.ledger import possible_verdicts
from inbounds.study.ledger.verdicts import STATES


def by_the_package(states: Sequence[str], needed: int) -> list[bool]:
    reachable = [STATES[:3] if state == "missing" else (state,) for state in states]
    found = possible_verdicts(reachable, needed)
    return ["supported" in found, "refuted" in found]


def counted(states: Sequence[str], needed: int, open_too: bool = False, gaps: bool = True) -> list[bool]:
    left = gaps * states.count("missing") + open_too * states.count("open")
    return [
        states.count("for") + left >= needed,
        states.count("against") + left > len(states) - needed,
    ]


def test_right_answers_pass() -> None:
    assert graders.within_reach(by_the_package).passed is True
    assert graders.within_reach(counted).passed is True
    assert graders.within_reach(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda s, n: counted(s, n, open_too=True), "an open statement stays open"),
        (lambda s, n: counted(s, n, gaps=False), "may still come out either way"),
        (lambda s, n: by_the_package(s, n)[::-1], "changed places"),
        (
            lambda s, n: [by_the_package(s, n)[0], s.count("against") + s.count("missing") >= len(s) - n],
            "more against it than it can spare",
        ),
        (
            lambda s, n: [by_the_package(s, n)[0], s.count("against") + s.count("missing") >= n],
            "no mirror image",
        ),
        (lambda s, n: [False, True], "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.within_reach(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict
