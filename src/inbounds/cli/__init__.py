"""The command `inbounds`: train, watch, bench, study, doctor, grade; `inbounds --version` says which one it is.

>>> main(["watch", "no/such/run"])  # what to do instead goes to standard error
1
"""

from __future__ import annotations

import errno
import itertools
import os
import sys
from collections.abc import Sequence

import inbounds
from inbounds.cli.errors import CommandError, complain, is_unread

__all__ = ["main"]

EXAMPLES = {
    "train": """\
  inbounds train HalfCheetah-v5 --policy logit-normal --algo ppo --seeds 10 --epochs 500
  inbounds train Hopper-v5 --policy beta --preset as-printed --out runs/hopper-beta
  inbounds train Ant-v5 --algo trpo --algorithm.max-kl 0.02 --policy.initial-std 0.5 --tensorboard
  inbounds train my_module:MyTask-v0 --epochs 50      (imports my_module.py, which registers MyTask-v0)
  inbounds train HalfCheetah-v5 --epochs 1000      (goes on with the first one, to epoch 1000)
  inbounds train --algo trpo --preset as-printed --help      (the values of that algorithm and preset)""",
    "watch": """\
  inbounds watch runs/HalfCheetah-v5-logit-normal-ppo
  inbounds watch runs/hopper-beta --greedy mode --seed-index 3 --seconds 5 --out hop.mp4""",
    "bench": """\
  inbounds bench
  inbounds bench --help""",
    "study": """\
  inbounds study status
  inbounds study run standard --nice 19 --max-minutes 60
  inbounds study run --scheduler tcp://host:8786      (on a Dask cluster; see `inbounds.study.running.cluster`)
  inbounds study report --out report.html
  inbounds study verify --random 2 --epochs 20
  inbounds study dial --help      (a task with three knobs: when does the law matter?)""",
    "study dial": """\
  inbounds study dial run            (about ten minutes of one core; goes on where it stopped)
  inbounds study dial status
  inbounds study dial show
  inbounds study dial verify --random 2""",
    "doctor": """\
  inbounds doctor""",
    "grade": """\
  inbounds grade lab/04_beta_policies.ipynb
  inbounds grade handed-in --seconds 300 --out grades.csv""",
}


def main(args: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        args: of the command line, without the program's name; None takes `sys.argv`.

    Returns:
        The exit code: 0, or 1 where something failed, 2 where the command line is wrong, 130 after Ctrl-C,
        141 where nobody reads the output any more.
    """
    args = list(sys.argv[1:] if args is None else args)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # no letter that a terminal lacks ends a run
            stream.reconfigure(errors="replace")
    try:
        code = _run(args)
        if sys.stdout is not None:  # closed, as some daemons have it
            sys.stdout.flush()  # here, where it can still be told that nobody reads it
        return code
    except KeyboardInterrupt:
        print("\ninbounds: interrupted", file=sys.stderr)
        return 130
    except (BrokenPipeError, SystemExit) as error:  # whoever read the output (`| head`) has had enough
        if not is_unread(error):
            raise
        _write_no_more()
        return 141
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _write_no_more()
        where = error.filename or "where the output goes"
        return complain(f"the disk is full ({where}): make room, and run it again")


def _write_no_more() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for Python's own last flush


def _run(args: list[str]) -> int:
    if args == ["--version"]:
        print(f"inbounds {inbounds.__version__}")
        return 0
    if args == ["doctor"]:  # before all that may be missing
        return _doctor()
    # Not at the top: torch takes seconds to import, during which Ctrl-C should find the handler above.
    from inbounds.cli import benchmark, options, training, watching
    from inbounds.headless import BackendError

    parsed = False
    try:
        if args[:1] == ["bench"] and benchmark.find_root():
            return benchmark.run(args[1:])  # its options are its own
        if args[:1] == ["study"]:
            from inbounds.cli.studying import study

            return study(args[1:])
        command, parsed = options.parse(args), True
        if isinstance(command, options.Train):
            return training.run(command)
        if isinstance(command, options.Watch):
            return watching.run(command)
        if isinstance(command, options.Doctor):
            return _doctor()
        if isinstance(command, options.Grade):
            from inbounds.cli.classroom import grading

            return grading.run(command.notebooks, command.seconds, command.gigabytes, command.out)
        return benchmark.run([])
    except SystemExit as exit_:  # tyro has written its help, or what is wrong
        if is_unread(exit_):
            raise
        if parsed:  # an environment's, or its module's
            code = exit_.code if exit_.code and isinstance(exit_.code, int) else 1
            return complain(f"the environment ended the process: sys.exit({exit_.code!r})", code)
        if exit_.code == 0:
            print(f"\nexamples:\n{_examples(args)}")
        return exit_.code if isinstance(exit_.code, int) else 1
    except CommandError as error:
        return complain(error, error.exit_code)
    except BackendError as error:
        return complain(error)
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:
            raise
        return complain(f"a name is too long for the disk ({error.filename}): choose a shorter one", 2)


def _examples(args: list[str]) -> str:
    """Return those of the command that the words name, else of the one it belongs to, else one after another."""
    named = " ".join(itertools.takewhile(lambda word: not word.startswith("-"), args))
    for words in (2, 1):
        if (name := " ".join(args[:words])) in EXAMPLES:
            lines = EXAMPLES[name].splitlines()
            of_its_own = [line for line in lines if f"{line} ".startswith(f"  inbounds {named} ")]
            return "\n".join(of_its_own or lines)
    return "\n".join(text for name, text in EXAMPLES.items() if " " not in name)


def _doctor() -> int:
    try:
        from inbounds.cli.classroom import doctor
    except ModuleNotFoundError as error:  # what it looks and prints with
        package = (error.name or "").partition(".")[0]
        return complain(f"the package {package} is missing: pip install . in the source tree")
    return doctor.run()
