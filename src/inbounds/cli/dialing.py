"""`inbounds study dial run | status | show | verify`: the map of when the law matters."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from inbounds.cli.commands import Lines, read_one_of
from inbounds.cli.errors import CommandError, complain, complain_of_files
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study.dial.cells import EPOCHS, dial_cells
from inbounds.study.dial.outcomes import DialOutcomes, constant_guess, tally
from inbounds.study.dial.running import DialFolder, run_cells, wrong_cells
from inbounds.study.dial.theory import MODELS
from inbounds.study.words import spoken

PROG = "inbounds study dial"
DESCRIPTION = "The dial: when does the law matter? A map over three knobs, fixed in results/DIAL.md."


@dataclass(frozen=True)
class _Where:
    results: Path = DialFolder.results
    """Folder of the map."""
    work: Path = DialFolder.work
    """Folder of the cells until the map is whole."""

    def folder(self) -> DialFolder:
        """Return the two folders."""
        return DialFolder(self.results, self.work)


@dataclass(frozen=True)
class Run(_Where):
    """Run the cells that are not finished, one after another, and write the map when all are."""


@dataclass(frozen=True)
class Status(_Where):
    """Say how many cells are finished, and whether the map is written."""


@dataclass(frozen=True)
class Show(_Where):
    """Print every comparison with its interval beside what was predicted, and how often each model was right."""


@dataclass(frozen=True)
class Verify(_Where):
    """Check the map's sum, and run the first epochs of some cells again."""

    random: int = 2
    """How many cells."""
    random_seed: int = 0
    """Of that choice."""
    epochs: int = 2
    """To run again."""


DialCommand: TypeAlias = Run | Status | Show | Verify
COMMANDS: dict[str, type[DialCommand]] = {"run": Run, "status": Status, "show": Show, "verify": Verify}


def dial(args: Sequence[str]) -> int:
    """Do what a command line after `inbounds study dial` says.

    Args:
        args: its words.

    Returns:
        The exit code: 0; 1 where something failed; 2 where the command line is wrong.

    Raises:
        CommandError: a check of nothing was asked for.
        SystemExit: help was asked for, or the command line is wrong; either has been written.

    Example:
        >>> dial(["status", "--results", "no/results", "--work", "no/work"])
        0 of 100 cells are finished, the map is not written
        no folder no/results here: the source tree has one with the map (--results)
        0
    """
    command: DialCommand = read_one_of(COMMANDS, args, PROG, DESCRIPTION)
    try:
        return _do(command, Lines().say)
    except DamagedFileError as error:
        return complain(error, prog=PROG)
    except OSError as error:
        return complain_of_files(error, PROG)


def _do(command: DialCommand, say: Callable[[str], None]) -> int:
    folder, cells = command.folder(), dial_cells()
    if isinstance(command, Run):
        whole = run_cells(cells, folder, say)
        say(f"map: {folder.map_file}" if whole else "the same command goes on with the others")
    elif isinstance(command, Status):
        finished = sum(folder.finished(cell) for cell in cells)
        if folder.map_file.is_file():
            say(f"the map is written; of its {len(cells)} cells, {finished} lie in {folder.work}")
        else:
            say(f"{finished} of {len(cells)} cells are finished, the map is not written")
            if not folder.results.is_dir():
                say(f"no folder {folder.results} here: the source tree has one with the map (--results)")
    elif isinstance(command, Show):
        _show(DialOutcomes(folder.read()), say)
    else:
        if command.random < 1 or not 1 <= command.epochs <= EPOCHS:
            raise CommandError(
                f"--random takes 1 or more cells, and --epochs 1 to {EPOCHS} of their epochs", 2
            )
        chosen = random.Random(command.random_seed).sample(cells, min(command.random, len(cells)))
        wrong = wrong_cells(folder, cells=chosen, epochs=command.epochs)
        for cell in chosen:
            say(f"{'WRONG' if cell.id in wrong else 'ok':5} {cell.id}")
        return 1 if wrong else 0
    return 0


def _show(outcomes: DialOutcomes, say: Callable[[str], None]) -> None:
    findings = outcomes.findings
    for finding in findings:
        knobs = finding.setting
        guesses = ", ".join(f"{m}: {finding.predicted[m]} ({finding.score(m)})" for m in MODELS)
        say(
            f"f={knobs.fraction:g} cost={knobs.cost} A={knobs.dims} {' − '.join(finding.comparison)} "
            f"{finding.endpoint}: {spoken(finding.found, 3)} {finding.kind}; {guesses}"
        )
    for model in MODELS:
        counts = tally(findings, model)
        say(f"{model}: " + ", ".join(f"{counts[score]} {score}" for score in ("right", "wrong", "undecided")))
    guess, right = constant_guess(findings)
    say(f"best constant guess, {guess}: {right} right")
