"""`inbounds study run | resume | status | evaluate | report | ledger | verify | dial`: what the words of the CLI do."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Self, TypeAlias

from tyro.conf import Positional, arg

from inbounds.cli.commands import Lines, blaming_the_words, read_one_of
from inbounds.cli.errors import CommandError, complain, complain_of_files
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study.grid import Cell, all_cells, select
from inbounds.study.ledger import Claim, claims_named, judge, quotes
from inbounds.study.outcomes import Outcomes
from inbounds.study.running.attempts import Settings
from inbounds.study.running.check_ways import check_ways
from inbounds.study.running.many_cells import run_study
from inbounds.study.running.one_cell import StudyError
from inbounds.study.running.play_records import publish_records
from inbounds.study.running.play_ways import evaluate_cells
from inbounds.study.running.progress import StudyProgress, cell_status, status_table
from inbounds.study.running.verify import Checked, verify
from inbounds.study.store import StudyFolder

PROG = "inbounds study"
DESCRIPTION = "The two studies of the book: algorithms, families and robots, ten seeds a cell."
Cells: TypeAlias = Annotated[Positional[tuple[str, ...]], arg(metavar="[CELL ...]")]


@dataclass(frozen=True)
class _Folders:
    results: Path = StudyFolder.results
    """Folder of the results."""
    work: Path = StudyFolder.work
    """Folder of claims and checkpoints."""

    def folder(self) -> StudyFolder:
        """Return the two folders."""
        return StudyFolder(self.results, self.work)


@dataclass(frozen=True)
class _Where(_Folders):
    cells: Cells = ()
    """Which: arms (standard, printed, beyond, mechanisms; the second study's equal, equal-more, as-they-come, noise,
    steps; afterwards, of neither protocol), ids, or patterns like '*-hopper-ppo-*'; by default all of the first
    protocol (status, evaluate and verify: all)."""

    def chosen(self) -> tuple[Cell, ...]:
        """Return the cells.

        Raises:
            ValueError: a pattern matches nothing.
        """
        return select(self.cells)


@dataclass(frozen=True)
class _WhereAll(_Where):
    def chosen(self) -> tuple[Cell, ...]:
        """Return the cells; without a pattern those outside the protocol, too."""
        return super().chosen() if self.cells else all_cells()


@dataclass(frozen=True)
class Run(_Where):
    """Run cells, in the study's order; finished ones stay, begun ones go on. Several of it may share a folder."""

    settings: Annotated[Settings, arg(name="")] = field(default_factory=Settings)


@dataclass(frozen=True)
class Resume(Run):
    """The same as run: every run goes on where the last one stopped."""


@dataclass(frozen=True)
class Status(_WhereAll):
    """Show how far the study is."""

    each: bool = False
    """A line for each cell."""


@dataclass(frozen=True)
class Evaluate(_WhereAll):
    """Play the shipped policies by every way to act: mean, median, mode, sample, and each action snapped to a bound.

    What has been played stays; the same command goes on with the others.
    """


@dataclass(frozen=True)
class Report(_Where):
    """Write an HTML page of figures and tables of all finished cells; what is missing is called missing."""

    out: Path = Path("runs/study-report.html")
    """The file; it needs no other."""


@dataclass(frozen=True)
class Ledger(_Folders):
    """Print what the finished cells say to claims of the source thesis, statement by statement."""

    claims: Annotated[Positional[tuple[str, ...]], arg(metavar="[CLAIM ...]")] = ()
    """Which, by their names in the ledger; by default all."""

    def chosen(self) -> tuple[Claim, ...]:
        """Return the claims.

        Raises:
            ValueError: there is none of such a name.
        """
        return claims_named(self.claims)


@dataclass(frozen=True)
class Verify(_WhereAll):
    """Check the sums of all results, run the first epochs of some cells and play some policies again."""

    epochs: int = 2
    """To run again."""
    rerun: tuple[str, ...] = ()
    """Which cells; by default one per algorithm, family and engine."""
    random: int = 0
    """Choose so many finished cells at random instead."""
    random_seed: int = 0
    """Of that choice."""


@dataclass(frozen=True)
class Dial:
    """A small task with three knobs, and when the law matters there: `inbounds study dial --help`."""


StudyCommand: TypeAlias = Run | Resume | Status | Evaluate | Report | Ledger | Verify
COMMANDS: dict[str, type[StudyCommand]] = {
    "run": Run,
    "resume": Resume,
    "status": Status,
    "evaluate": Evaluate,
    "report": Report,
    "ledger": Ledger,
    "verify": Verify,
}


def study(args: Sequence[str]) -> int:
    """Do what a command line after `inbounds study` says.

    Args:
        args: its words.

    Returns:
        The exit code: 0; 1 where something failed; 2 where the command line is wrong; 128 + a signal that ended it.

    Raises:
        CommandError: the dial was to check nothing.
        SystemExit: help was asked for, or the command line is wrong; either has been written.

    Example:
        >>> study(["status", "standard-swimmer-*", "--results", "no/results", "--work", "no/work", "--each"])
        standard-swimmer-ppo-gaussian: missing
        standard-swimmer-ppo-beta: missing
        standard-swimmer-ppo-logit-normal: missing
        standard-swimmer-trpo-gaussian: missing
        standard-swimmer-trpo-logit-normal: missing
        0
    """
    if args[:1] == ["dial"]:
        from inbounds.cli.dialing import dial

        return dial(args[1:])
    console = Lines()
    try:
        with blaming_the_words():  # for no ValueError of what is done thereafter
            command: StudyCommand = read_one_of(COMMANDS | {"dial": Dial}, args, PROG, DESCRIPTION)
            if isinstance(command, Ledger | Verify | Report | Evaluate) and not command.results.is_dir():
                raise ValueError(_no_folder(command.results))
            chosen: Any = command.chosen()  # claims of the ledger, else cells
        if isinstance(command, Ledger):
            return _ledger(command, chosen, console)
        if isinstance(command, Run):
            return _run(command, chosen, console)
        if isinstance(command, Status):
            return _status(command, chosen, console)
        if isinstance(command, Evaluate):
            return _evaluate(command, chosen, console)
        if isinstance(command, Report):
            return _report(command, chosen, console)
        return _verify(command, chosen, console)
    except CommandError as error:
        return complain(error, error.exit_code, PROG)
    except (DamagedFileError, StudyError) as error:
        return complain(error, prog=PROG)
    except OSError as error:
        return complain_of_files(error, PROG)


def _run(command: Run, cells: Sequence[Cell], console: Lines) -> int:
    folder = command.folder()
    summary = run_study(cells, folder, command.settings, StudyProgress(cells, folder, console))
    finished = sum("finished" in report.outcome for report in summary.reports.values())
    console.say(f"{finished} of {len(cells)} cells are finished")
    if finished < len(cells):
        console.say("the same command goes on with the others")
    if summary.signal:
        return 128 + summary.signal
    return 1 if summary.failed else 0


def _status(command: Status, cells: Sequence[Cell], console: Lines) -> int:
    if command.each:
        for cell in cells:
            console.say(f"{cell.id}: {cell_status(cell, command.folder())}")
    else:
        if not command.results.is_dir():  # a cell may be under way all the same
            console.say(_no_folder(command.results))
        console.print(status_table(cells, command.folder()))
    return 0


def _evaluate(command: Evaluate, cells: Sequence[Cell], console: Lines) -> int:
    played = evaluate_cells(cells, command.folder(), console.say)
    if publish_records(cells, command.folder()):
        console.say("records: played")
    console.say(f"{len(played)} cell{'s' if len(played) != 1 else ''} played now")
    return 0


def _report(command: Report, cells: Sequence[Cell], console: Lines) -> int:
    try:
        from inbounds.book.report.study_report import write_report
    except ImportError as error:
        raise StudyError(
            f"the report needs Matplotlib and Jinja2 ({error}): pip install '.[report]' in the source tree"
        ) from error
    with _Now(console, "reading the cells"):
        outcomes = Outcomes.read(command.folder(), cells)
    try:
        with _Now(console, "writing") as now:
            path = write_report(outcomes, command.out, lambda section: now.say(f"writing: {section}"))
    except OSError as error:
        raise StudyError(f"{command.out} could not be written ({error}): choose another --out") from error
    console.say(f"{len(outcomes.finished)} of {len(cells)} cells are finished")
    console.say(f"report: {path}")
    return 0


def _ledger(command: Ledger, claims: Sequence[Claim], console: Lines) -> int:
    outcomes = Outcomes.read(command.folder())
    for claim in claims:
        found = judge(outcomes, claim)
        lines = [
            f"{claim.id}: {quotes.verdict(found)} ({found.counted})",
            f"  {claim.says} ({claim.where})",
            f"  {claim.test} ({claim.standing})",
        ]
        lines += [f"  judged anew: {anew}"] if (anew := quotes.judged_anew(found)) else []
        lines += [f"    {statement}" for statement in found.statements]
        planned = select(claim.cells) if claim.cells else ()
        others = {c.id: state for c in planned if (state := outcomes.states[c.id]) != "finished"}
        if others:
            lines.append(
                f"  {found.cells} cells are finished; the others: inbounds study run {' '.join(others)}"
            )
        lines += [
            f"  {name}: {state}, and so not used" for name, state in others.items() if state != "missing"
        ]
        console.say("\n".join(lines))
    return 0


def _verify(command: Verify, cells: Sequence[Cell], console: Lines) -> int:
    def show(finding: Checked) -> None:
        mark = "ok" if finding.ok else "WRONG"
        console.say(f"{mark:5} {finding.subject}: {finding.message}")

    if command.random < 0 or command.epochs < 1:
        raise CommandError("--random takes 0 or more cells, and --epochs 1 or more", 2)
    if command.random and command.rerun:
        raise CommandError("--rerun names the cells and --random chooses them: give one of the two", 2)
    with blaming_the_words():
        rerun = select(command.rerun, cells) if command.rerun else None
    if command.random:
        finished = [cell for cell in cells if command.folder().state(cell) == "finished"]
        chooser = random.Random(command.random_seed)
        rerun = tuple(chooser.sample(finished, min(command.random, len(finished))))
    with _Now(console, "looking into the files, and running first epochs again"):
        findings = verify(cells, command.folder(), epochs=command.epochs, rerun=rerun, on_finding=show)
    findings += check_ways(cells if rerun is None else rerun, command.folder(), show)
    return 0 if all(finding.ok for finding in findings) else 1


class _Now:
    """What is being done, while it is done: a line that turns on a terminal, plain lines elsewhere."""

    def __init__(self, console: Lines, doing: str) -> None:
        self._console, self._doing, self._status = console, doing, console.status(doing)

    def __enter__(self) -> Self:
        self._status.start()
        self.say(self._doing)
        return self

    def __exit__(self, *_error: object) -> None:
        self._status.stop()

    def say(self, doing: str) -> None:
        """Say what is done now."""
        self._status.update(doing)
        if not self._console.is_terminal:
            self._console.say(doing)


def _no_folder(results: Path) -> str:
    return f"no folder {results} here: go to the source tree, or name it with --results"
