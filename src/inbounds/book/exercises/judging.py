"""How an exercise is judged: a grader runs the reader's function and says what is wrong, in words.

Each grader is named after the exercise's function, and returns a :class:`Judgement` that a notebook shows. An exercise
that has not been answered (its function still returns ``...``) is not a failure: *Run All* goes on.

The references here are written differently from the chapters' solutions, so that a slip in one is not a slip in both.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from inbounds.book.building import builds_the_book
from inbounds.book.templates import macros


@dataclass(frozen=True)
class Judgement:
    """What a grader found.

    Made by `judge_cases`, which has an example.
    """

    exercise: str
    """Name of the reader's function."""
    passed: bool | None
    """True, False, or None for an exercise not yet answered."""
    message: str
    """One sentence: what was checked, or what is wrong."""

    @property
    def mark(self) -> str:
        """How it went, in two words."""
        return {True: "✓ passed", False: "✗ not yet", None: "… not answered"}[self.passed]

    def __repr__(self) -> str:
        return f"{self.mark}: {self.exercise}: {self.message}"

    def _repr_html_(self) -> str:
        kind = {True: "tip", False: "warning", None: "note"}[self.passed]
        mark = f"{self.mark}, by the book's solution" if self.passed and builds_the_book() else self.mark
        return str(macros("judgement").box(kind, mark, self.exercise, self.message))


@dataclass(frozen=True)
class Case:
    """One call of the reader's function, what it should return, and what known mistakes would return.

    Judged by `judge_cases`, which has an example.
    """

    arguments: tuple[Any, ...]
    expected: Any
    mistakes: dict[str, Any]
    """Diagnosis → the wrong value that betrays it."""
    hint: str = "the value is wrong"
    """What to say when the value is wrong in no known way."""
    rtol: float = 1e-6


def judge_cases(function: Callable[..., Any], cases: list[Case], success: str) -> Judgement:
    """Run every case; stop at the first wrong value and name the mistake behind it, if it is a known one.

    Args:
        function: the reader's.
        cases: in the order in which they should fail.
        success: what to say when all is right.

    Example:
        >>> from inbounds.book.exercises.judging import Case
        >>> square = Case((3.0,), 9.0, {"that is the double, not the square": 6.0})
        >>> judge_cases(lambda x: 2 * x, [square], "squares are right")
        ✗ not yet: <lambda>: that is the double, not the square
    """
    name = getattr(function, "__name__", "your function")
    for case in cases:
        given = [_copied(each) for each in case.arguments]
        try:
            answer = detached(function(*case.arguments))
        except Exception as error:
            return Judgement(name, False, f"it raised {type(error).__name__}: {error}")
        if answer is None:
            return Judgement(name, None, "it returns nothing: write it, with a return at the end")
        if answer is ... or answer is NotImplemented:
            return Judgement(name, None, "write it, and run this cell again")
        left = [_copied(each) for each in case.arguments]
        if not all(map(_alike, given, left)):
            return Judgement(name, False, "it changes an array that it was given: work on a copy")
        if agrees(answer, case.expected, case.rtol):
            continue
        for diagnosis, wrong in case.mistakes.items():
            if agrees(answer, wrong, case.rtol):
                return Judgement(name, False, diagnosis)
        return Judgement(name, False, f"{case.hint}: {_beside(answer, case.expected, case.rtol)}")
    return Judgement(name, True, success)


def judge_by_checks(
    function: Callable[..., Any],
    checks: Mapping[str, Callable[[Any], str | None]],
    answered: Callable[[], bool],
    fallback: str = "your function",
) -> Judgement:
    """Run named checks in their order; the first that finds something wrong gives the verdict.

    Args:
        function: the reader's.
        checks: by name, what is wrong with a function, or nothing.
        answered: whether the function returns something of the right kind yet.
        fallback: what to call a function without a name.

    Example:
        >>> checks = {"sign": lambda f: "" if f(-1) < 0 else "it loses the sign"}
        >>> judge_by_checks(abs, checks, lambda: abs(1) is not ...)
        ✗ not yet: abs: check "sign": it loses the sign
    """
    name = getattr(function, "__name__", fallback)
    for check, wrong in checks.items():
        try:
            if not answered():
                return Judgement(name, None, "write it, and run this cell again")
            complaint = wrong(function)
        except Exception as error:
            return Judgement(name, False, f'check "{check}": it raised {type(error).__name__}: {error}')
        if complaint:
            return Judgement(name, False, f'check "{check}": {complaint}')
    return Judgement(name, True, f"all {len(checks)} checks pass")


def judge_diagnosis(
    answers: Mapping[Any, Any],
    broken: Mapping[Any, Callable[..., Any]],
    checks: Mapping[str, Callable[[Any], str | None]],
    noun: str,
    stopped_before: str,
    lets_pass: str,
) -> Judgement:
    """Judge the reader's prediction of which check stops which broken function.

    Args:
        answers: the reader's, by function: the name of the first check that finds something wrong.
        broken: the functions, under the same names.
        checks: in their order.
        noun: what one of the functions is called.
        stopped_before: hint when an earlier check stops it; ``{answer}`` stands for the check named.
        lets_pass: hint when the check named finds nothing wrong.

    Example:
        >>> checks = {"sign": lambda f: "" if f(-1) < 0 else "it loses the sign"}
        >>> judge_diagnosis({"A": "sign"}, {"A": abs}, checks, "function", "earlier", "later")
        ✓ passed: diagnosis: every bug is stopped by the check that you named
    """
    if any(answers.get(name, ...) is ... for name in broken):
        return Judgement("diagnosis", None, f"name a check for every {noun}, and run this cell again")
    if unknown := [answer for answer in answers.values() if answer not in list(checks)]:
        return Judgement(
            "diagnosis", False, f"no check is called {unknown[0]!r}; there are {', '.join(checks)}"
        )
    order = list(checks)
    for name, function in broken.items():
        answer = answers[name]
        first = next((check for check, wrong in checks.items() if wrong(function)), None)
        if answer == first:
            continue
        stopped = first is not None and order.index(first) < order.index(answer)
        hint = (stopped_before if stopped else lets_pass).format(answer=answer)
        return Judgement("diagnosis", False, f"{noun} {name}: {hint}")
    return Judgement("diagnosis", True, "every bug is stopped by the check that you named")


def detached(answer: Any) -> Any:
    """An answer without autograd's graph: NumPy refuses a tensor that has one, and no value depends on it.

    Example:
        >>> detached((torch.ones(1, requires_grad=True), 2.0))
        (tensor([1.]), 2.0)
    """
    if isinstance(answer, torch.Tensor):
        return answer.detach()
    return type(answer)(map(detached, answer)) if type(answer) in (list, tuple) else answer


def _copied(argument: Any) -> np.ndarray | None:
    """A copy of an array or a tensor; nothing of anything else."""
    return np.asarray(detached(argument)).copy() if isinstance(argument, (np.ndarray, torch.Tensor)) else None


def _alike(before: np.ndarray | None, after: np.ndarray | None) -> bool:
    if before is None or after is None:
        return before is after
    return np.array_equal(before, after, equal_nan=before.dtype.kind in "fc")


def agrees(answer: Any, expected: Any, rtol: float) -> bool:
    """Whether two numbers or arrays have the same shape and values."""
    try:
        answer, expected = np.asarray(answer, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return answer.shape == expected.shape and np.allclose(
        answer, expected, rtol=rtol, atol=0.0, equal_nan=True
    )


def _beside(answer: Any, expected: Any, rtol: float) -> str:
    """What was expected and what came; of two arrays alike in shape the first entry that differs."""
    try:
        found, right = np.asarray(answer, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    except (TypeError, ValueError):
        found = right = np.zeros(())
    if found.shape != right.shape and found.size == right.size == 1:
        return f"the number is to have the shape {list(right.shape)}, got {list(found.shape)}"
    if found.shape != right.shape or found.size < 2:
        return _apart(brief(expected), brief(answer))
    wrong = ~np.isclose(found, right, rtol=rtol, atol=0.0, equal_nan=True)
    place = tuple(int(i) for i in np.argwhere(wrong)[0])
    where = f"{wrong.sum()} of {right.size} numbers differ, first that at {list(place)}"
    return f"{where}: {_apart(brief(right[place]), brief(found[place]))}"


def _apart(expected: str, got: str) -> str:
    """Two values side by side; where they are written alike, what keeps them apart."""
    if expected == got:
        return f"{got} is right to about six digits and no further: compute in double precision"
    return f"expected {expected}, got {got}"


def brief(value: Any) -> str:
    """A value, short enough for a sentence."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return repr(value)[:60]
    if array.size == 1:
        return f"{array.item():.6g}"
    return (
        f"an array of shape {array.shape} that starts with {array.flat[0]:.6g}" if array.size else "nothing"
    )
