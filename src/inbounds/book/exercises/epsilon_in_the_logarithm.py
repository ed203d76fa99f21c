"""Grader of the page *The ε in the logarithm* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

import torch

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def log_slope(function: Callable[..., Any]) -> Judgement:
    """The logarithm of 1 - tanh(x)², in single precision, with its gradient by autograd."""

    def value_and_gradient(x: float | list[float]) -> list[Any]:
        point = torch.tensor(x, dtype=torch.float32, requires_grad=True)
        answer = function(point)
        if not isinstance(answer, torch.Tensor):
            return answer  # unanswered; the judge says so
        (gradient,) = torch.autograd.grad(answer.sum(), point)
        return [answer.tolist(), gradient.tolist()]

    value_and_gradient.__name__ = getattr(function, "__name__", "your function")

    def case(x: float, hint: str) -> Case:
        # 1 - tanh² = 1/cosh², and log cosh x = |x| + log(1 + exp(-2|x|)) - log 2
        exact = -2 * (abs(x) + math.log1p(math.exp(-2 * abs(x))) - math.log(2))
        slope = -2 * math.tanh(x)
        mistakes = {
            "the sign is wrong: 1 − tanh² is below one, its logarithm negative": [-exact, -slope],
            "a factor 2 is missing: that is the log of 1/cosh, not of 1/cosh²": [exact / 2, slope / 2],
            "that is the slope of tanh(x/2): here the squash is tanh(x)": [
                -2 * (abs(x) / 2 + math.log1p(math.exp(-abs(x)))) + math.log(2),
                -math.tanh(x / 2),
            ],
        }
        return Case((x,), [exact, slope], mistakes, hint=hint, rtol=3e-5)

    alone = [case(x, "").expected for x in (-60.0, 0.3, 30.0)]
    together = [list(column) for column in zip(*alone, strict=True)]
    far = "far out the value is −2|x| + log 4 and the slope ∓2: something is added, clamped, or rounded to 0"
    overflow = "for large negative x an exponential overflows: softplus, logaddexp or |x| keep it in range"
    cases = [
        case(0.3, "the value or its derivative is wrong"),
        case(-1.7, "the value or its derivative is wrong for negative x"),
        case(8.0, far),
        case(30.0, far),
        case(-60.0, overflow),
        Case(
            ([-60.0, 0.3, 30.0],),
            together,
            {},
            hint="right for single numbers, wrong for a tensor",
            rtol=3e-5,
        ),
    ]
    return judge_cases(
        value_and_gradient, cases, "right, value and derivative, on both sides, as far as float32 goes"
    )
