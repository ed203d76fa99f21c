"""TensorBoard events: each seed a run of its own, so that TensorBoard lays their curves over one another."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Self

from inbounds.cli.errors import CommandError
from inbounds.learning import Trainer
from inbounds.learning.storage.whole_files import is_disk_full
from inbounds.learning.training import Record

_NOT_CURVES = ("epoch", "env_steps")


class TensorBoardWriter:
    """A callback for `inbounds.learning.train` that writes every number of every epoch; a context manager.

    A run that goes on writes its whole history anew and has TensorBoard drop what was there, so that nothing appears
    twice that an interrupted run had written after its last checkpoint.

    Args:
        directory: where the folders seed-0, seed-1, … go.
        seeds: of the run.

    Raises:
        CommandError: TensorBoard is not installed, or the directory cannot be made.
    """

    def __init__(self, directory: Path, seeds: tuple[int, ...]) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise CommandError(
                "--tensorboard needs TensorBoard: pip install '.[tensorboard]' in the source tree"
            ) from error
        make: Any = SummaryWriter
        try:
            self._writers = [make(str(directory / f"seed-{seed}"), purge_step=0) for seed in seeds]
        except OSError as error:
            if is_disk_full(error):
                raise CommandError(
                    f"the disk is full: {directory} cannot be written. Make room first"
                ) from error
            raise CommandError(
                f"{directory} cannot hold TensorBoard's files ({error.strerror or error}): "
                "move it away, or choose another --out"
            ) from error
        self._written = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for writer in self._writers:
            try:
                writer.close()
            except OSError:
                if error is None:  # else that one says more
                    raise

    def __call__(self, trainer: Trainer, record: Record) -> None:
        """Write what is new; the first time, all."""
        for new in trainer.records[self._written :]:
            for name in new.keys() - set(_NOT_CURVES):
                for s, writer in enumerate(self._writers):
                    value = new[name] if name == "seconds" else new[name][s]
                    writer.add_scalar(name, float(value), new["env_steps"])
        self._written = len(trainer.records)
