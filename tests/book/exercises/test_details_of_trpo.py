"""The grader of *What TRPO's details do* passes a right product and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import details_of_trpo as graders


def fisher_blocks(features, log_scale, v_weight, v_log_scale, *, outer=None):
    second = np.mean([np.outer(phi, phi) for phi in features], axis=0) if outer is None else outer(features)
    return v_weight @ second / np.exp(2 * log_scale)[:, None], 2 * v_log_scale


def changed(weight=lambda w, ls: w, log=lambda s, ls: s, **options) -> Callable:
    def function(features, log_scale, v_weight, v_log_scale):
        first, second = fisher_blocks(features, log_scale, v_weight, v_log_scale, **options)
        return weight(first, log_scale), log(second, log_scale)

    return function


def test_the_linear_product_passes() -> None:
    assert graders.linear_fisher_product(fisher_blocks).passed is True
    assert graders.linear_fisher_product(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (changed(log=lambda s, ls: s / 2), "2, whatever σ is"),
        (changed(log=lambda s, ls: s / np.exp(2 * ls)), "that of σ"),
        (changed(weight=lambda w, ls: w * np.exp(ls)[:, None]), "not σ"),
        (changed(weight=lambda w, ls: w * np.exp(4 * ls)[:, None]), "*divided*"),
        (changed(outer=lambda phi: phi.T @ phi), "sum over states"),
        (changed(outer=lambda phi: np.diag((phi**2).mean(0))), "φφᵀ, not φ²"),
        (changed(outer=lambda phi: np.outer(phi.mean(0), phi.mean(0))), "outer products"),
        (changed(weight=lambda w, ls: 0 * w), "expected"),
    ],
)
def test_known_mistakes_of_the_linear_product_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.linear_fisher_product(wrong)
    assert verdict.passed is False
    assert words in verdict.message


RIGHT = {"linear_fisher_product": fisher_blocks}
