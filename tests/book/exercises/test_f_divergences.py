"""The grader of *Every divergence, and every map* passes a right answer and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.special import log_ndtr

from inbounds.book.exercises import f_divergences as graders


def log_probabilities(loc, scale, edges):
    """By logarithms: log(Φ(v) − Φ(u)), from the side on which it keeps its digits."""
    u = (np.concatenate([[-np.inf], edges, [np.inf]]) - loc) / scale
    a, b = np.where(u[:-1] > 0, -u[1:], u[:-1]), np.where(u[:-1] > 0, -u[:-1], u[1:])
    return log_ndtr(b) + np.log1p(-np.exp(log_ndtr(a) - log_ndtr(b)))


def kl(log_p, log_q):
    return np.sum(np.exp(log_p) * (log_p - log_q))


def binned(loc, scale, loc_new, scale_new, edges):
    return kl(log_probabilities(loc, scale, edges), log_probabilities(loc_new, scale_new, edges))


RIGHT = {"binned_kl": binned}


def gaussian(loc, scale, loc_new, scale_new, edges):
    return np.log(scale_new / scale) + (scale**2 + (loc - loc_new) ** 2) / (2 * scale_new**2) - 0.5


def inner(loc, scale, loc_new, scale_new, edges, *, normalised=False):
    old, new = (log_probabilities(*law, edges)[1:-1] for law in ((loc, scale), (loc_new, scale_new)))
    if normalised:
        old, new = (x - np.log(np.exp(x).sum()) for x in (old, new))
    return kl(old, new)


def one_sided(loc, scale, loc_new, scale_new, edges):
    """As one writes it first: Φ of the upper edge minus Φ of the lower."""
    edges = np.concatenate([[-np.inf], edges, [np.inf]])
    p, q = (np.diff(stats.norm.cdf(edges, *law)) for law in ((loc, scale), (loc_new, scale_new)))
    return np.sum(p * np.log(p / q))


def with_tails(loc, scale, loc_new, scale_new, edges):
    """From the side on which a difference keeps its digits, and without logarithms."""
    p, q = (np.exp(log_probabilities(*law, edges)) for law in ((loc, scale), (loc_new, scale_new)))
    return np.sum(p * np.log(p / q))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (gaussian, "sum over the bins"),
        (lambda m, s, m_new, s_new, edges: binned(m_new, s_new, m, s, edges), "new to old"),
        (inner, "first and the last bin"),
        (lambda *a: inner(*a, normalised=True), "made to sum to one"),
        (lambda *a: -binned(*a), "sign"),
        (lambda *a: binned(*a) / np.log(2), "nats"),
        (one_sided, "Φ(−9) is not"),
        (with_tails, "take logarithms"),
        (lambda *a: 0.0, "expected"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.binned_kl(wrong)
    assert verdict.passed is False
    assert words in verdict.message
