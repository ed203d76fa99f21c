"""Deliberate errors, one a line or two, and the test that must notice each.

``tests/test_mutants.py`` copies the package, plants one, runs the named test and expects it to fail.
Add a mutant whenever you write a line whose loss would change a result in silence.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One planted error: in ``file`` (below src/inbounds), ``old`` becomes ``new``; ``test`` must fail."""

    name: str
    file: str
    old: str
    new: str
    test: str


MUTANTS: tuple[Mutant, ...] = ()
