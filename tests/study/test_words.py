"""Numbers in words, at the edges of their formats."""

import numpy as np
import pytest

from inbounds.study.words import p_equals, p_value


@pytest.mark.parametrize(
    ("p", "words"),
    [
        (1.0, "1.000"),
        (0.0421, "0.042"),
        (0.0015, "0.002"),
        (0.001, "0.001"),
        (np.nextafter(0.001, 0), "< 0.001"),
        (0.0, "< 0.001"),
        (np.nan, ""),
    ],
)
def test_a_p_value_has_three_digits_down_to_a_thousandth(p: float, words: str) -> None:
    assert p_value(p) == words
    assert p_equals(p) == (words and (f"p {words}" if words.startswith("<") else f"p = {words}"))
