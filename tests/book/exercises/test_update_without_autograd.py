"""The graders of *The same update, without autograd* pass right answers, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import update_without_autograd as graders


def value_slope(value, old, target, clip):
    near = np.abs(value - old) <= clip
    held = np.clip(value, old - clip, old + clip) - target
    return np.where(np.abs(value - target) >= np.abs(held), 2 * (value - target), np.where(near, 2 * held, 0))


def residual(weight, bias, x, upstream):
    inner = upstream / np.cosh(weight @ x + bias[:, None]) ** 2
    return np.einsum("ib,jb->ij", inner, x), inner @ np.ones(x.shape[1]), upstream + weight.T @ inner


RIGHT = {"clipped_value_slope": value_slope, "residual_backward": residual}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda v, o, t, c: 2 * (v - t), "alone"),
        (lambda *a: value_slope(*a) / 2, "factor 2"),
        (lambda *a: -value_slope(*a), "sign"),
        (
            lambda v, o, t, c: np.where(
                np.abs(v - t) >= np.abs(np.clip(v, o - c, o + c) - t),
                2 * (v - t),
                2 * (np.clip(v, o - c, o + c) - t),
            ),
            "does not depend on V",
        ),
        (
            lambda v, o, t, c: np.where(
                np.abs(v - t) < np.abs(np.clip(v, o - c, o + c) - t),
                2 * (v - t),
                2 * (np.clip(v, o - c, o + c) - t) * (np.abs(v - o) <= c),
            ),
            "takes the larger",
        ),
        (lambda *a: 3 * value_slope(*a), "expected"),
    ],
)
def test_known_mistakes_of_the_value_loss_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.clipped_value_slope(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def without(weight, bias, x, upstream, what: str):
    slope = 1 / np.cosh(weight @ x + bias[:, None]) ** 2
    inner = upstream if what == "slope" else upstream * slope
    back = weight if what == "transposed" else weight.T
    direct = 0 if what == "direct" else upstream
    by_bias = inner.mean(1) if what == "sum" else inner.sum(1)
    return inner @ x.T, by_bias, direct + back @ inner


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("direct", "direct one is missing"),
        ("slope", "slope of tanh"),
        ("sum", "not the mean"),
        ("transposed", "transposed"),
    ],
)
def test_known_mistakes_of_the_residual_layer_are_named(what: str, words: str) -> None:
    verdict = graders.residual_backward(lambda *a: without(*a, what=what))
    assert verdict.passed is False
    assert words in verdict.message
