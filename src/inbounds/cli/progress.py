"""How training goes, while it goes: a live bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import contextlib
import os
import time
import warnings
from collections import deque
from types import TracebackType
from typing import Any, Self

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.text import Text

from inbounds.cli.errors import is_unread
from inbounds.learning import Trainer
from inbounds.learning.storage.whole_files import is_disk_full
from inbounds.learning.training import Record

SECONDS_BETWEEN_LINES = 1.0


class TrainingProgress:
    """A callback for `inbounds.learning.train` that shows each epoch; use it as a context manager.

    The return is the mean over seeds of each seed's last known mean, ± the standard deviation over seeds. Diverged
    seeds are counted, and left out of every number. Warnings appear as lines above the bar.

    Args:
        epochs: at which the run ends.
        console: where to write; by default standard output.

    Example:
        >>> from inbounds.learning import preset, train
        >>> with TrainingProgress(epochs=1) as progress:  # doctest: +ELLIPSIS
        ...     run = train(preset("common", "Swimmer-v5", seeds=2, epochs=1), callback=progress)
        epoch 1/1  return ... ± ...  KL ...  saturation ... %  ... steps/s  0:00 left
    """

    def __init__(self, epochs: int, console: Console | None = None) -> None:
        self.epochs = epochs
        self.unread: tuple[str, int] | None = None
        """Why what was written last did not arrive, and the exit code for it."""
        # In a notebook too, plain lines: they can be read in the stored file.
        self.console = console or Console(highlight=False, force_jupyter=False)
        self.moves = self.console.is_terminal and not self.console.is_dumb_terminal
        """Whether a line can be written over."""
        self._returns: Any = None  # [S], of each seed the last one known
        self._recent: deque[tuple[float, int]] = deque(maxlen=20)  # (time, env steps of all seeds)
        self._last_line = -np.inf
        self._live = Live(self._picture(f"epoch 0/{epochs}", 0), console=self.console, refresh_per_second=4)

    def __enter__(self) -> Self:
        self._warnings = warnings.catch_warnings()
        self._warnings.__enter__()
        warnings.showwarning = lambda message, *_args, **_kwargs: self.say(f"warning: {message}")
        self.start_clock()
        if self.moves:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()
        self._warnings.__exit__(kind, error, trace)

    def start_clock(self) -> None:
        """Count time from here on: what came before, such as compiling, is no part of training."""
        self._recent.clear()
        self._recent.append((time.perf_counter(), 0))

    def __call__(self, trainer: Trainer, record: Record) -> None:
        """Show an epoch."""
        now, done = time.perf_counter(), len(trainer.records)
        horizon = trainer.config.algorithm.horizon
        self._recent.append((now, self._recent[-1][1] + horizon * len(trainer.config.seeds)))
        self._remember_returns(trainer)
        text = self._describe(record, done)
        if self.moves:
            self._live.update(self._picture(text, done))
        elif now - self._last_line >= SECONDS_BETWEEN_LINES or done >= self.epochs:
            self.say(text)
            self._last_line = now

    def say(self, text: str) -> None:
        """Write a line, above the bar."""
        try:
            self.console.print(text, markup=False, soft_wrap=True)
        except (OSError, SystemExit) as error:
            if not is_unread(error) and not is_disk_full(error):
                raise
            # In mid-epoch, perhaps: whoever asks stops at its end.
            nobody = "nobody reads the output any more", 141
            self.unread = nobody if is_unread(error) else ("the output's disk is full", 1)

    def say_stopping(self) -> None:
        """Add to the line above the bar, in answer to Ctrl-C, when the run will stop; safe in a signal's handler."""
        said = "stopping after this epoch; again: at once"
        if self.moves:
            self._line.append(f"  {said}", style="bold")
        else:
            with contextlib.suppress(OSError):
                os.write(2, f"{said}\n".encode())  # the console may be in the middle of a line of its own

    def _picture(self, text: str, done: int) -> Group:
        """Return the numbers, and a bar below them that is as wide as the terminal."""
        self._line = Text(text)
        return Group(self._line, ProgressBar(total=self.epochs, completed=done))

    def _remember_returns(self, trainer: Trainer) -> None:
        """Take in the returns of the last epoch; at first, of all epochs that a resumed run has behind it."""
        records = trainer.records if self._returns is None else trainer.records[-1:]
        for record in records:
            new = record["return_mean"]
            self._returns = new if self._returns is None else np.where(np.isnan(new), self._returns, new)

    def _describe(self, record: Record, done: int) -> str:
        """Return one line about one epoch."""
        healthy = ~record["diverged"]
        returns = self._returns[healthy & np.isfinite(self._returns)]
        spread = f" ± {format_return(returns.std(ddof=1))}" if len(returns) > 1 else ""
        (then, steps_then), (now, steps_now) = self._recent[0], self._recent[-1]
        seconds = max(now - then, 1e-9)
        left = seconds / (len(self._recent) - 1) * max(self.epochs - done, 0)
        parts = [
            f"epoch {done}/{self.epochs}",
            f"return {format_return(returns.mean())}{spread}" if len(returns) else "return –",
            f"KL {_mean(record['kl'][healthy]):#.2g}",
            f"saturation {100 * _mean(record['saturation'][healthy]):.1f} %",
            f"{(steps_now - steps_then) / seconds:,.0f} steps/s",
            f"{_clock(left)} left",
        ]
        if not healthy.all():
            parts.append(f"{(~healthy).sum()} of {len(healthy)} seeds diverged")
        return "  ".join(parts)


def format_return(value: float) -> str:
    """Return a return, or its spread, as it is told: with one decimal, and a very large one by its first digits.

    Example:
        >>> format_return(-1234.56), format_return(1e32)
        ('-1234.6', '1e+32')
    """
    return f"{value:.1f}" if abs(value) < 1e9 else f"{value:.3g}"


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
