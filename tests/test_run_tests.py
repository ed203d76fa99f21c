"""`make test` takes a skipped test for a failed one, but for the live robot's without npm and a GPU's without one."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from tools import run_tests


@pytest.mark.parametrize(
    ("reason", "bad", "told"),
    [
        (
            "the live robot is not tested here: npm cannot be reached",
            0,
            "1 tests of the live robot were left out",
        ),
        ("needs a GPU that torch can use", 0, "torch finds no GPU: 1 tests of one were left out"),
        ("tired", 1, "package and book: 1 passed, 1 failed"),
    ],
)
def test_what_may_be_skipped(
    reason: str, bad: int, told: str, tmp_path: Path, capfd: pytest.CaptureFixture
) -> None:
    path = tmp_path / "test_two.py"
    path.write_text(f"import pytest\n\ndef test_a(): pass\n\ndef test_b(): pytest.skip({reason!r})\n")
    assert run_tests.run(["-p", "no:cacheprovider", str(path)], {"package and book"}) == bad
    said = capfd.readouterr().out
    assert told in said
    assert ("left out" in said) == (not bad)


def test_the_files_that_take_longest_are_named() -> None:
    times = [("tests.a", "1"), ("tests.b", "2"), ("tests.a", "2.5"), ("tests.c", "0.5")]
    cases = [ElementTree.Element("testcase", {"classname": name, "time": time}) for name, time in times]
    assert run_tests.longest(cases, 2) == [("tests.a", 3.5), ("tests.b", 2.0)]
