"""What the first cell of a student's copy asks: is there what this notebook needs?"""

from __future__ import annotations

from inbounds.cli.classroom.doctor import Diagnosis, look_at_packages, look_at_python
from inbounds.study.store import ROOT, StudyFolder

INSTALL = 'pip install -c constraints.txt -e ".[book,lab]"'
"""What brings everything, in the folder of the book; `-e`, because Part IV reads the results that lie there."""


def look_at_results() -> Diagnosis:
    """Look whether the study's results lie where the package finds them."""
    try:
        folder = StudyFolder.shipped(ROOT)
    except FileNotFoundError:
        return Diagnosis("results", "optional", "not there: Part IV reads them", INSTALL)
    return Diagnosis("results", "fine", str(len(list((folder.results / "cells").glob("*.parquet")))))


def ready() -> None:
    """Print in a line what is there, and what only some chapters lack.

    Raises:
        RuntimeError: something is missing without which no notebook runs; the message says what to do.

    Example:
        >>> ready()  # doctest: +ELLIPSIS
        Ready: Python ..., packages ..., packages (book) ..., results ....
    """
    found = [look_at_python(), look_at_packages(), look_at_packages("book"), look_at_results()]
    # What is optional for the package is not for a notebook: they all draw, and grade.
    lacking = [
        each
        for each in found
        if each.state == "missing" or (each.state, each.name) == ("optional", "packages (book)")
    ]
    if lacking:
        told = "; ".join(f"{each.name}: {each.found}" for each in lacking)
        raise RuntimeError(f"{told}. In the folder of the book: {INSTALL}")
    print(f"Ready: {', '.join(f'{each.name} {each.found}' for each in found)}.")
