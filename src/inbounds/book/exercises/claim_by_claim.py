"""Graders of the chapter *The thesis, claim by claim* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def within_reach(function: Callable[..., Any]) -> Judgement:
    """Whether a claim can still be supported, and whether it can still be refuted."""

    def case(states: list[str], needed: int, hint: str) -> Case:
        right = _reach(states, needed, gaps=("missing",))
        known = {
            "an open statement stays open: only what is missing can still change": _reach(
                states, needed, gaps=("missing", "open")
            ),
            "a missing statement may still come out either way: count it for both": _reach(
                states, needed, gaps=()
            ),
            "refuted needs more against it than it can spare; as many are not enough": [
                right[0],
                _against(states, ("missing",)) >= len(states) - needed,
            ],
            "refuted is no mirror image: it takes more against the claim than it can spare": [
                right[0],
                _against(states, ("missing",)) >= needed,
            ],
            "the two answers have changed places: [supported, refuted]": right[::-1],
        }
        return Case((states, needed), right, {s: w for s, w in known.items() if w != right}, hint)

    cases = [
        case(["for", "for", "missing"], 3, "all three must hold, and the last may"),
        case(["for", "open", "open", "open", "missing", "missing"], 4, "what is open stays open"),
        case(["for", "against", "missing", "missing"], 2, "the missing ones may go either way"),
        case(["against", "against", "open", "open"], 2, "refuted: more against it than it can spare"),
        case(["against", "open", "missing"], 1, "one of three is enough for this claim"),
    ]
    return judge_cases(function, cases, "right: what is open stays, and what is missing may go either way")


def _against(states: list[str], gaps: tuple[str, ...]) -> int:
    return states.count("against") + sum(state in gaps for state in states)


def _reach(states: list[str], needed: int, gaps: tuple[str, ...]) -> list[bool]:
    most = states.count("for") + sum(state in gaps for state in states)
    return [most >= needed, _against(states, gaps) > len(states) - needed]
