"""`inbounds train`: a run in a directory, which can be interrupted at any time and gone on with."""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import errno
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import gymnasium

from inbounds import robots  # its names are imported on first use, and MuJoCo with them
from inbounds.cli.errors import NO_MEMORY, CommandError, is_ours, lacks_memory
from inbounds.cli.modules import find_modules_here, module_of
from inbounds.cli.options import Train, format_seeds, quoted
from inbounds.cli.progress import TrainingProgress
from inbounds.cli.tensorboard import TensorBoardWriter
from inbounds.headless import BackendError
from inbounds.learning import FAMILIES, TrainConfig, Trainer, train
from inbounds.learning.rollout import check_environments
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.run_store import (
    CHECKPOINT_FILE,
    CURVES_FILE,
    POLICIES_FILE,
    load_checkpoint,
    save_run,
)
from inbounds.learning.storage.stored_config import FREE_TO_CHANGE, changed_fields
from inbounds.learning.storage.whole_files import DamagedFileError, held, is_disk_full, remove_leftovers
from inbounds.learning.training import Record, make_environments, prepare
from inbounds.learning.updates.engine import compiled_engine
from inbounds.robots.registration import TASK_NAMES


class Stop:
    """Takes signals to stop: the first stops the run after the epoch under way, the second at once."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        self._say: Callable[[], None] = lambda: None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        if self.signal is not None:
            raise KeyboardInterrupt
        self.signal = signal.Signals(number)
        self._say()

    @contextlib.contextmanager
    def listening(self, say: Callable[[], None]) -> Iterator[None]:
        """Take Ctrl-C, what job schedulers send, and a closed terminal as such signals; `say` that one has come."""
        self._say = say
        numbers = [signal.SIGINT, signal.SIGTERM]
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
            numbers.append(signal.SIGHUP)
        before = {number: signal.signal(number, self) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class Stopped(Exception):  # noqa: N818 (no error)
    """Training has stopped after an epoch, and everything is kept."""

    def __init__(self, said: str, exit_code: int) -> None:
        super().__init__(said)
        self.exit_code = exit_code


def run(command: Train) -> int:
    """Train, or go on training, with progress on standard output.

    Raises:
        CommandError: what was asked for cannot be had, or cannot be kept; the message names the fix.
    """
    config, run_dir = command.train_config(), command.run_dir()
    folder = run_dir.absolute()  # from here on an environment may change the directory
    room = run_dir if os.path.exists(run_dir) else next(p for p in folder.parents if os.path.exists(p))
    has_state = _check_environment(config)
    with _claimed(folder):
        return _Session(command, config, run_dir, folder, room, has_state).run()


STEP_SIZES = ("policy_learning_rate", "max_kl", "learning_rate")
"""What decides how far an epoch moves the networks, as far as an algorithm has it."""


def step_sizes(algorithm: type[Any]) -> list[str]:
    """Return the options that decide how far an epoch moves the networks.

    Args:
        algorithm: the class of its configuration.
    """
    fields = algorithm.__dataclass_fields__
    return [f"--algorithm.{name.replace('_', '-')}" for name in STEP_SIZES if name in fields]


class _Session:
    """One process' part of a run: what it does after every epoch, and what it says when it ends."""

    def __init__(
        self, command: Train, config: TrainConfig, run_dir: Path, folder: Path, room: Path, has_state: bool
    ) -> None:
        self.done = self.kept = _epochs_kept(folder, config)
        # A run that has more epochs than are asked for keeps them, and goes on saying so.
        self.config = dataclasses.replace(config, epochs=max(config.epochs, self.done))
        self.run_dir, self.folder = run_dir, folder  # as it was named, and wherever the process is
        self.stop = Stop()
        self.room = room  # the run directory, or the folder that it would be made in
        self.has_state = has_state  # of the environments: else an episode under way cannot be gone on with
        self.wants_tensorboard = command.tensorboard

    def run(self) -> int:
        """Train to the end, or say how far it came and what is kept."""
        config, start = self.config, self.done
        with contextlib.ExitStack() as stack:
            progress = self.progress = stack.enter_context(TrainingProgress(config.epochs))
            watchers: list[Any] = [progress]
            if config.engine == "compiled":
                try:
                    compiled_engine(FAMILIES[config.policy.family])  # before anything is promised
                    progress.say("compiling the update for this processor; the next run finds it on disk")
                    progress.say(f"compiled, or found on disk, in {prepare(config):.1f} s")
                except ValueError as error:
                    if not is_ours(error):
                        raise
                    raise CommandError(str(error), 2) from error
            if self.wants_tensorboard:  # when nothing is left that could refuse the command
                board = TensorBoardWriter(self.folder / "tensorboard", config.seeds)
                watchers.append(stack.enter_context(board))
            if start:
                goes_on = self.has_state or start == config.epochs
                anew = "" if goes_on else f"; {config.env} cannot save its state, so new episodes begin"
                progress.say(f"going on with {self.run_dir}, {_epochs(start)} done{anew}")
            progress.start_clock()
            for name in (CURVES_FILE, POLICIES_FILE):
                remove_leftovers(self.folder / name)  # of a process that was killed while it wrote
            try:
                with self.stop.listening(progress.say_stopping):
                    trainer = train(
                        config,
                        run_dir=self.folder,
                        callback=lambda trainer, record: self._after_epoch(trainer, record, watchers),
                    )
                    self._save(trainer)
                    if self.wants_tensorboard and not self.done > start:
                        board(trainer, trainer.records[-1])
            except Stopped as stopped:
                raise CommandError(self._kept(str(stopped)), stopped.exit_code) from None
            except KeyboardInterrupt:
                raise CommandError(self._kept("stopped in mid-epoch"), 130) from None
            except ValueError as error:
                if lacks_memory(error):
                    raise self._out_of_memory() from error
                if self.done > start or not is_ours(error):
                    raise  # no fault of the command's: nothing was wrong with the first epoch
                raise CommandError(str(error), 2) from error
            except BrokenPipeError as error:  # not of the output, which `progress` sees to
                raise RuntimeError("a process that the environment talks to has gone") from error
            except OSError as error:
                if not (is_ours(error) or is_disk_full(error)):
                    raise  # the environment's own
                raise self._unwritten(error) from error
            except (Exception, SystemExit) as error:  # the environment's own, too
                if lacks_memory(error):
                    raise self._out_of_memory() from error
                progress.say(self._kept("stopped by an error"))
                raise
        return self._conclude(trainer, start)

    def _out_of_memory(self) -> CommandError:
        return CommandError(f"{NO_MEMORY}. {self._kept('Training stopped')}")

    def _after_epoch(self, trainer: Trainer, record: Record, watchers: list[Any]) -> None:
        self.done = len(trainer.records)
        if trainer.checkpoint_due:
            self.kept = self.done  # `train` has just written the checkpoint
            save_run(self.folder, trainer)
        for watcher in watchers:
            watcher(trainer, record)
        if self.stop.signal is not None:
            self._save(trainer)
            raise Stopped("stopped", 128 + self.stop.signal)
        if self.progress.unread is not None:
            self._save(trainer)
            why, exit_code = self.progress.unread
            raise Stopped(f"stopped, because {why}", exit_code)

    def _save(self, trainer: Trainer) -> None:
        """Have all files say the same, also where `train` leaves no checkpoint or was killed between two files."""
        if self.kept < len(trainer.records):
            checkpoint.save(self.folder / CHECKPOINT_FILE, trainer.state_dict())
            self.kept = len(trainer.records)
        save_run(self.folder, trainer)

    def _conclude(self, trainer: Trainer, start: int) -> int:
        if trainer.diverged.all():
            options = " or ".join(step_sizes(type(self.config.algorithm)))
            slower = f"train with a smaller {options} in another --out"
            mended = (
                "mend the environment, which has returned an observation or a reward that is no finite number"
            )
            advice = mended if trainer.fed_nonsense.any() else slower
            if not self.done > start:  # the run of another day, which did not note why
                advice = f"{slower}; or, if it returned an observation or a reward that is NaN, mend the environment"
            raise CommandError(
                f"all seeds diverged, the last in epoch {len(trainer.records) - 1}; the curves are in "
                f"{quoted(self.run_dir)}. What helps: {advice}"
            )
        done = (
            f"done: {_epochs(self.done)}"
            if self.done > start
            else f"there was nothing to do: {_epochs(start)} {'is' if start == 1 else 'are'} done"
        )
        print(f"{done}. {self.run_dir} has {CURVES_FILE}, {POLICIES_FILE} and {CHECKPOINT_FILE}")
        if robots.is_drawable(trainer.envs):
            trust = " --trust" if module_of(self.config.env) else ""
            print(f"film it: inbounds watch {quoted(self.run_dir)}{trust}")
        return 0

    def _kept(self, what: str) -> str:
        if not self.kept:
            return f"{what} before the first checkpoint: nothing is kept"
        return (
            f"{what}. {quoted(self.run_dir)} keeps {_epochs(self.kept)}; the same command goes on from there"
        )

    def _unwritten(self, error: OSError) -> CommandError:
        if is_disk_full(error):
            room = f"Make room first (df -h {quoted(self.room)})"
            return CommandError(f"the disk is full. {self._kept('Training stopped')}. {room}")
        return CommandError(f"{self.run_dir} cannot be written: {error}. Choose another --out")


def _check_environment(config: TrainConfig) -> bool:
    """Return whether the environment can save its state; raise unless it can be made, and say what to ask for."""
    tasks = f"The tasks are {', '.join(TASK_NAMES)}"
    try:
        if module_of(config.env) is not None:
            if len(parts := config.env.split(":")) != 2 or not all(parts):
                raise CommandError(f"{config.env!r} is no environment: give an id, or module:id. {tasks}", 2)
            find_modules_here()
        with contextlib.closing(make_environments(config, 1)) as envs:
            check_environments(envs, 1)
            return hasattr(envs, "get_state")
    except BackendError:
        raise
    except gymnasium.error.UnregisteredEnv as error:
        module, _, name = config.env.rpartition(":")
        close = difflib.get_close_matches(name, [*TASK_NAMES, *gymnasium.registry], n=1)
        meant = f"did you mean {module + ':' if module else ''}{close[0]}? " if close else ""
        raise CommandError(
            f"no environment {config.env!r}: {meant}{tasks}; any other id that gymnasium.make knows will do too, "
            "as module:id where a module has to be imported first",
            2,
        ) from error
    except (gymnasium.error.Error, ImportError, ValueError) as error:
        if isinstance(error, ValueError) and not is_ours(error):
            raise  # the environment's own
        raise CommandError(f"{config.env} will not do: {str(error).rstrip('.')}. {tasks}", 2) from error


def _epochs(count: int) -> str:
    return f"{count} epoch{'' if count == 1 else 's'}"


def _epochs_kept(run_dir: Path, config: TrainConfig) -> int:
    """Return how many epochs the run directory holds; raise where going on would lose or mix something."""
    if not (run_dir / CHECKPOINT_FILE).exists():
        if any((run_dir / name).exists() for name in (CURVES_FILE, POLICIES_FILE)):
            raise CommandError(
                f"{run_dir} holds a run without its checkpoint, which a new one would overwrite: choose another --out, "
                f"or move {run_dir} out of the way"
            )
        return 0
    try:
        state = load_checkpoint(run_dir)
    except DamagedFileError as error:
        raise CommandError(str(error)) from error
    except FileNotFoundError as error:  # a folder of that name
        raise CommandError(
            f"{run_dir / CHECKPOINT_FILE} is no file: choose another --out, or move it out of the way"
        ) from error
    except PermissionError as error:
        raise CommandError(
            f"{run_dir}: its checkpoint cannot be read ({error.strerror}): change its permissions"
        ) from error
    if changes := _changes(config, state["config"]):
        raise CommandError(
            f"{run_dir} is the run of another configuration ({changes}): choose another --out, or ask for that one",
            2,
        )
    return len(state["records"])


def _changes(config: TrainConfig, stored: dict[str, Any]) -> str:
    """Return what a `Trainer` would refuse to change in mid-run, as the command line spells it."""
    different = changed_fields(config, stored, FREE_TO_CHANGE)
    if "algorithm_name" in different:  # another algorithm has other options, too
        different = {"algo": different["algorithm_name"]}
    spelt = {"policy.family": "--policy", "env": "environment"}  # the others as they are called
    return "; ".join(
        f"{spelt.get(name, '--' + name.replace('_', '-'))} {_word(name, there)} there, {_word(name, here)} here"
        for name, (there, here) in different.items()
    )


def _word(name: str, value: Any) -> str:
    """Return an option's value as the command line takes it."""
    if name == "seeds":
        return format_seeds(value)
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


@contextlib.contextmanager
def _claimed(run_dir: Path) -> Iterator[None]:
    """Make the run directory and hold it, so that no second process trains in it at the same time."""
    new = [path for path in (run_dir, *run_dir.parents) if not os.path.exists(path)]
    with contextlib.ExitStack() as stack:
        stack.callback(_remove_empty, new)
        try:
            run_dir.mkdir(parents=True, exist_ok=True)
            stack.enter_context(held(run_dir))
        except BlockingIOError as error:
            raise CommandError(
                f"another process trains in {run_dir}: wait until it is done, or choose another --out"
            ) from error
        except OSError as error:
            if error.errno == errno.ENAMETOOLONG:
                raise
            said = "no room on the disk" if is_disk_full(error) else error.strerror
            raise CommandError(
                f"{run_dir} cannot be a run directory ({said}): choose another --out"
            ) from error
        yield


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with contextlib.suppress(OSError):  # something came of it
            folder.rmdir()
