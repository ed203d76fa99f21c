"""Whether `results/evaluations` is what it says: its files looked into, and some policies played again.

On the processor and with the wheels of an evaluation its rows must be repeated exactly. Elsewhere rounding differs, and
chaotic physics amplifies the difference: there the rewards of the first env steps are compared, to `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pyarrow as pa

from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import store
from inbounds.study.grid import Cell
from inbounds.study.running.play_ways import play_cell
from inbounds.study.running.provenance import provenance
from inbounds.study.running.verify import TOLERANCE, Checked, same_arithmetic
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import evaluated, evaluation_file, read_ways, schema

_REPLAYED = ("median-snapped",)  # falls early: the cheapest, and its actions are the median's


def check_ways(
    cells: Iterable[Cell], folder: StudyFolder, on_finding: Callable[[Checked], None] = lambda finding: None
) -> list[Checked]:
    """Look into the evaluations of cells, and play one of each family again, of those with which nothing is wrong.

    Args:
        cells: of the study; those that were not evaluated are passed over.
        folder: where the results are.
        on_finding: called with each finding as it is made.

    Returns:
        What is wrong, and what was played again.

    Example:
        >>> from inbounds.study import select
        >>> [finding.ok for finding in check_ways(select(["standard-hopper-ppo-beta"]), StudyFolder())]
        [True]
    """
    sound, findings = [], []
    for cell in evaluated(folder, cells):
        if said := wrong_evaluation(cell, folder):
            findings.append(Checked(f"evaluations/{cell.id}", False, said))
            on_finding(findings[-1])
        else:
            sound.append(cell)
    first = {cell.family: cell for cell in reversed(sound)}
    for cell in first.values():
        findings.append(check_replay(cell, folder))
        on_finding(findings[-1])
    return findings


def wrong_evaluation(cell: Cell, folder: StudyFolder) -> str:
    """Return what is wrong with a cell's evaluation, the first thing; empty where nothing is."""
    try:
        read_ways(folder, cell)
    except DamagedFileError as error:
        return str(error)
    return ""


def check_replay(cell: Cell, folder: StudyFolder, ways: Sequence[str] = _REPLAYED) -> Checked:
    """Play the policies of an evaluated cell again and compare with its rows.

    Args:
        cell: which.
        folder: where the results are.
        ways: to act.
    """
    subject, path = f"evaluations/{cell.id}", evaluation_file(folder, cell)
    if said := wrong_evaluation(cell, folder):
        return Checked(subject, False, said)
    kept = [row for row in store.read_cell(path).to_pylist() if row["way"] in ways]
    found = pa.Table.from_pylist(play_cell(cell, folder, ways), schema()).to_pylist()
    there = store.read_metadata(path)["session"]
    if same_arithmetic(provenance(), there):
        wrong = [(a, b) for a, b in zip(kept, found, strict=True) if repr(a) != repr(b)]  # NaN equals NaN
        if wrong:
            return Checked(subject, False, f"{wrong[0][1]} instead of {wrong[0][0]}")
        return Checked(subject, True, f"{len(found)} episodes ({', '.join(ways)}) repeated exactly")
    first = np.array([[row["first_reward"] for row in rows] for rows in (kept, found)])
    first = first[:, ~np.isnan(first).all(axis=0)]  # a diverged seed has none, here as there
    error = float(np.max(np.abs(first[1] - first[0]) / (1 + np.abs(first[0])), initial=0.0))
    said = f"rewards of the first steps differ by at most {error:.1e} (tolerance {TOLERANCE:g})"
    return Checked(
        subject, error <= TOLERANCE, f"{said}; another processor or other wheels than {there['processor']}"
    )
