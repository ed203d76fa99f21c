"""The grader of *What single precision does to a Beta* passes the right answer and names the known mistakes."""

from collections.abc import Callable

import pytest
import torch
from torch.distributions import Beta, kl_divergence

from inbounds.book.exercises import digits_of_a_beta as graders


def torchs_kl(alpha, beta, alpha_new, beta_new):
    old, new = Beta(alpha.double(), beta.double()), Beta(alpha_new.double(), beta_new.double())
    return kl_divergence(old, new).float()


RIGHT = {"safe_beta_kl": torchs_kl}


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("safe_beta_kl", lambda a, b, c, d: torchs_kl(c, d, a, b), "changed places"),
        ("safe_beta_kl", lambda *four: -torchs_kl(*four), "minus the divergence"),
        ("safe_beta_kl", lambda *four: torchs_kl(*four).double(), "type"),
        (
            "safe_beta_kl",
            lambda *four: torch.from_numpy(graders.float32_kl(*four)),
            "single precision cancels",
        ),
        ("safe_beta_kl", lambda a, b, c, d: kl_divergence(Beta(a, b), Beta(c, d)), "single precision"),
    ],
)
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False, verdict
    assert words in verdict.message
