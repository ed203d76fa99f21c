import json

import numpy as np
import pytest

from tests.learning.golden import PATH, golden_run
from tests.learning.small import ALGORITHMS, FAMILIES


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_results_are_what_they_were(algo: str, family: str) -> None:
    expected = json.loads(PATH.read_text(encoding="utf8"))[f"{algo}/{family}"]
    found = golden_run(algo, family)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert np.allclose(found[name], value, rtol=1e-6, atol=1e-9), name
