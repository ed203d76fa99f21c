"""Whether the results are what they say: checksums, and the first epochs of chosen cells run again.

On the processor and with the wheels that a cell began on, its rows must be repeated exactly. Elsewhere rounding
differs, and chaotic physics amplifies the difference: there the rewards of the first env steps of each seed are
compared, to `TOLERANCE`, and nothing is trained.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from inbounds.learning import Trainer
from inbounds.learning.storage.run_metadata import COMPILERS
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import store
from inbounds.study.grid import Cell
from inbounds.study.running import file_checks
from inbounds.study.running.measure import MeasuredTrainer
from inbounds.study.running.provenance import provenance
from inbounds.study.store import CHECKSUMS_FILE, StudyFolder
from inbounds.study.ways_played import FIRST_STEPS

TOLERANCE = 1e-3
"""Of rewards, absolute and relative, in the first steps on another machine."""


WHEELS = ("torch", "mujoco", "gymnasium", "numpy", "scipy")
"""The packages whose versions decide the last bits of a result; with the compiled engine numba and llvmlite do, too."""
CHEAP_FIRST = ("Swimmer", "Hopper", "Walker2d", "HalfCheetah", "Ant", "Humanoid")
"""The robots by what an env step of theirs costs."""
NOTHING_TO_RERUN = "skipped: none of its cells is finished"


class Checked(NamedTuple):
    """What a check found.

    Made by `verify`, which has an example.
    """

    subject: str
    """A file or a cell."""
    ok: bool
    """Whether it is as it should be."""
    message: str
    """What was compared, or what is wrong and what to do."""


def verify(
    cells: Sequence[Cell],
    folder: StudyFolder,
    *,
    epochs: int = 2,
    rerun: Sequence[Cell] | None = None,
    on_finding: Callable[[Checked], None] = lambda finding: None,
) -> list[Checked]:
    """Check the sums of all results, and run the first epochs of some cells again.

    Args:
        cells: of the study; those without results are passed over.
        folder: where the results are.
        epochs: to run again, of each chosen cell.
        rerun: which cells; None is one of each algorithm × family × engine, as `check_column` chooses it, () none.
        on_finding: called with each finding as it is made.

    Returns:
        The findings, bad ones included.

    Example:
        >>> from inbounds.study import StudyFolder, select
        >>> findings = verify(select(["standard-hopper-ppo-beta"]), StudyFolder(), rerun=())
        >>> all(finding.ok for finding in findings)
        True
    """
    findings: list[Checked] = []

    def say(finding: Checked) -> None:
        findings.append(finding)
        on_finding(finding)

    for finding in [*check_sums(folder), *check_cells(cells, folder)]:
        say(finding)
    if rerun is None:
        for column in columns(cells):
            say(check_column(cells, folder, *column, epochs))
    for cell in rerun or ():
        say(check_rerun(cell, folder, epochs))
    return findings


def columns(cells: Sequence[Cell]) -> list[tuple[str, str, str]]:
    """Return each algorithm × family × engine among some cells, in their order.

    Example:
        >>> from inbounds.study.grid import study_cells
        >>> len(columns(study_cells()))
        8
    """
    return list(dict.fromkeys((cell.algorithm, cell.family, cell.engine) for cell in cells))


def check_column(
    cells: Sequence[Cell], folder: StudyFolder, algorithm: str, family: str, engine: str, epochs: int
) -> Checked:
    """Run the first epochs of a finished cell of a column again; say so where it has none.

    It is the cheapest of those that must be repeated exactly here; where there is none, the column's first.
    """
    wanted = (algorithm, family, engine)
    column = [cell for cell in cells if (cell.algorithm, cell.family, cell.engine) == wanted]
    finished = [cell for cell in column if folder.state(cell) == "finished"]
    if not finished:
        return Checked(" × ".join(wanted), True, NOTHING_TO_RERUN)
    exact = [cell for cell in finished if _computed_as_here(cell, folder)]
    return check_rerun(min(exact, key=_cost, default=finished[0]), folder, epochs)


def _computed_as_here(cell: Cell, folder: StudyFolder) -> bool:
    try:
        sessions = store.read_metadata(folder.cell_file(cell)).get("sessions", [])
    except DamagedFileError:
        return False
    return bool(sessions) and same_arithmetic(provenance(), sessions[0], cell.engine)


def _cost(cell: Cell) -> tuple[int, int]:
    """Return the env steps of an epoch, and how dear the robot's are."""
    return len(cell.seeds) * cell.config.algorithm.horizon, CHEAP_FIRST.index(cell.robot)


def check_sums(folder: StudyFolder) -> list[Checked]:
    """Compare every listed file with its sum, and list the files that nobody lists."""
    sums = folder.checksums()
    findings = []
    for name, expected in sums.items():
        path = folder.results / name
        if not path.is_file():
            findings.append(Checked(name, False, f"missing: {store.restore(path)}"))
        elif store.sha256(path) != expected:
            findings.append(Checked(name, False, f"its checksum is wrong: {store.restore(path)}"))
    found = {path.relative_to(folder.results).as_posix() for path in _data_files(folder.results)}
    findings += [
        Checked(name, False, f"not in {CHECKSUMS_FILE}: delete it, or restore the list")
        for name in sorted(found - sums.keys())
    ]
    if not sums and not found:
        return [Checked(CHECKSUMS_FILE, False, "nothing is finished here: another --results?")]
    good = len(sums) - sum(not finding.ok and finding.subject in sums for finding in findings)
    return [*findings, Checked(CHECKSUMS_FILE, good > 0, f"{good} of {len(sums)} files have their checksums")]


def check_cells(cells: Sequence[Cell], folder: StudyFolder) -> list[Checked]:
    """Look into all files of each cell: whether they are listed, of the study, and hold what they must."""
    sums = folder.checksums()
    findings = []
    for cell in cells:
        path = folder.cell_file(cell)
        if not path.is_file():
            continue
        for file in folder.files(cell):
            name = file.relative_to(folder.results).as_posix()
            if name not in sums and not file.is_file():  # else `check_sums` has seen it
                said = f"missing, and not in {CHECKSUMS_FILE}: {store.restore(file)}"
                findings.append(Checked(name, False, said))
        if said := _wrong(cell, folder):
            findings.append(Checked(cell.id, False, said))
    return findings


def _wrong(cell: Cell, folder: StudyFolder) -> str:
    """Return what is wrong with the contents of a cell's files, the first thing; empty where nothing is."""
    path, (policies, returns) = folder.cell_file(cell), folder.policy_files(cell)
    tables: list[tuple[Path, Callable[[Cell, pa.Table], str]]] = [(path, file_checks.wrong_rows)]
    if cell.keeps_policies and returns.is_file():
        tables.append((returns, file_checks.wrong_returns))
    for file, look in tables:
        try:
            metadata, table = store.read_metadata(file), store.read_cell(file)
        except DamagedFileError as error:
            return str(error)
        if not store.is_of(cell, metadata):
            version = metadata["study_version"]
            return f"{file} is of study version {version} or another configuration: move it away"
        if file == path and (lost := sorted({"sessions", "first_rewards"} - metadata.keys())):
            return f"{file} does not say how it was made ({lost[0]} is missing): {store.restore(file)}"
        if said := look(cell, table):
            return f"{file}: {said}: {store.restore(file)}"
    if cell.keeps_policies and policies.is_file() and (said := file_checks.wrong_policies(cell, policies)):
        return f"{policies}: {said}: {store.restore(policies)}"
    return ""


def check_rerun(cell: Cell, folder: StudyFolder, epochs: int) -> Checked:
    """Run the first epochs of a cell again and compare them with its rows; on another machine, its first steps."""
    path = folder.cell_file(cell)
    if not path.is_file():
        return Checked(cell.id, False, f"there is no {path}: nothing to compare with")
    if said := _wrong(cell, folder):
        return Checked(cell.id, False, said)
    metadata = store.read_metadata(path)
    if not same_arithmetic(provenance(), metadata["sessions"][0], cell.engine):
        return _compare_first_rewards(cell.id, first_rewards(cell), metadata)
    rows, epochs = store.read_cell(path), min(epochs, cell.epochs)
    with closing(MeasuredTrainer(dataclasses.replace(cell, epochs=epochs))) as run:
        for _ in range(epochs):
            run.epoch()
    mismatch = first_mismatch(rows.filter(pc.less(rows["epoch"], epochs)), run.table())
    if mismatch:
        return Checked(
            cell.id,
            False,
            f"{mismatch}: the engine now gives other results; a new study version is due, or the change undone",
        )
    return Checked(cell.id, True, f"{epochs} epochs repeated exactly")


def first_rewards(cell: Cell) -> NDArray[Any]:
    """Return the rewards `[S, T]` of a cell's first env steps, which come before the first update."""
    trainer = Trainer(cell.config)
    with closing(trainer.envs):
        rollout = trainer.collector.collect(min(FIRST_STEPS, cell.config.algorithm.horizon))
    return rollout.reward.double().numpy()


def same_arithmetic(here: Mapping[str, Any], there: Mapping[str, Any], engine: str = "autograd") -> bool:
    """Return whether two processes have processor and wheels in common, and so compute the same bits with an engine."""
    wheels = (*WHEELS, *COMPILERS) if engine == "compiled" else WHEELS
    noted = [name for name in wheels if name in there["versions"]]
    same_wheels = all(here["versions"].get(name) == there["versions"][name] for name in noted)
    return same_wheels and here["processor"] == there["processor"]


def first_mismatch(expected: pa.Table, found: pa.Table) -> str:
    """Return where two tables of the same cell first differ, wall times aside; empty where nowhere.

    NaN equals NaN, null equals null, and everything else only itself.
    """
    for name in expected.column_names:
        if name in store.TIMINGS:
            continue
        if name not in found.column_names:
            if expected[name].null_count == len(expected):  # not measured in so few epochs
                continue
            return f"column {name} is missing"
        ours, theirs = found[name].combine_chunks(), expected[name].combine_chunks()
        if len(ours) != len(theirs):
            return f"{len(ours)} rows instead of {len(theirs)}"
        if not ours.equals(theirs):  # bitwise but for NaN and zeros
            for i, (a, b) in enumerate(zip(ours.to_pylist(), theirs.to_pylist(), strict=True)):
                if a != b and not (a != a and b != b):
                    row = expected.slice(i, 1).select(["epoch", "seed"]).to_pylist()[0]
                    return f"{name} is {a!r} instead of {b!r} in epoch {row['epoch']}, seed {row['seed']}"
    return ""


def _compare_first_rewards(name: str, found: NDArray[Any], metadata: dict[str, Any]) -> Checked:
    expected = np.array(metadata["first_rewards"])
    if found.shape != expected.shape:
        return Checked(name, False, f"rewards of shape {found.shape} instead of {expected.shape}")
    error = float(np.max(np.abs(found - expected) / (1 + np.abs(expected)), initial=0.0))
    said = f"rewards of the first {expected.shape[1]} steps differ by at most {error:.1e} (tolerance {TOLERANCE:g})"
    ran = f"; another processor or other wheels than {metadata['sessions'][0]['processor']}: no exact comparison"
    return Checked(name, bool(error <= TOLERANCE), said + ran)


def _data_files(results: Path) -> list[Path]:
    folders = ("cells", "policies", "evaluations", store.GREENHOUSE)
    single = [results / name for name in (store.MOTIONS, store.UNTRAINED)]
    paths = [path for part in folders for path in (results / part).glob("[!.]*")]
    return [path for path in (*paths, *single) if path.is_file()]
