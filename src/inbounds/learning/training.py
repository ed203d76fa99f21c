"""One loop for all algorithms: act, learn, record, save.

    >>> from inbounds.learning import preset, train
    >>> run = train(preset("common", "Swimmer-v5", policy="logit-normal", seeds=2, epochs=1))
    >>> run.records[-1]["env_steps"], run.records[-1]["kl"].shape
    (2048, (2,))

**The law of lockstep.** A seed's run does not depend on which other seeds it runs beside. On one machine, with one set
of wheels, this holds to the last bit for any two runs of two seeds or more, whatever the row a seed has in each, even
if a neighbour is all NaN; for hidden layers, horizons and minibatches that are multiples of 16. A seed *alone* takes
another path through the matrix library and agrees to the rounding of a single gradient step (measured over a few
updates: 1e-7 in float32, 1e-15 in float64), which a long run in chaotic physics amplifies. The engine `compiled`
learns from each seed by itself: alone or in company, bit for bit. Threads do not matter: training uses one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from numpy.typing import NDArray
from torch import Tensor

from inbounds import robots
from inbounds.headless import naming_the_backend
from inbounds.learning.config import ALGORITHMS, TrainConfig
from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.rollout import Collector, Rollout, check_environments
from inbounds.learning.seeding import SeedStreams, generator_states, restore_generators
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.stored_config import FREE_TO_CHANGE, changed_fields, describe
from inbounds.learning.storage.trained_policy import TrainedPolicy, policies_from
from inbounds.learning.storage.whole_files import claimed, remove_leftovers
from inbounds.learning.updates.diagnostics import episode_statistics, told_of_divergence
from inbounds.learning.updates.engine import compiled_engine
from inbounds.learning.updates.threads import one_thread
from inbounds.robots.registration import TASK_NAMES

Record: TypeAlias = dict[str, Any]
"""One epoch: `epoch`, `env_steps` (per seed, so far), `seconds` of wall time, and arrays `[S]` by name."""
Environments: TypeAlias = VectorEnv[Any, Any, Any]


class DivergedSeedWarning(RuntimeWarning):
    """A seed's weights are no longer finite: it stands still and is marked, the others go on."""


class Trainer:
    """A run under way: its state, and one epoch at a time.

    Args:
        config: what to do.
        make_envs: makes the vector environment for a number of seeds; None makes `config.env`.

    Raises:
        TypeError: no configuration, or no function that makes environments.
        ValueError: a `Collector` cannot act in the environments, their bounds are not finite and in order, nothing
            gives the policy's `initial_std`, or there is no engine `compiled`: no extra `fast`, or no kernels.

    Example:
        >>> from inbounds.learning.config import preset
        >>> trainer = Trainer(preset("common", "Hopper-v5", seeds=2))
        >>> record = trainer.epoch()
        >>> record["epoch"], record["env_steps"], record["episodes"].shape
        (0, 2048, (2,))
    """

    def __init__(self, config: TrainConfig, make_envs: Callable[[int], Environments] | None = None) -> None:
        if not isinstance(config, TrainConfig):
            raise TypeError(f"a run takes a TrainConfig, such as preset(...) gives, got {config!r}")
        if make_envs is not None and not callable(make_envs):
            raise TypeError(
                f"make_envs is a function of the number of seeds (lambda n: ...), got {make_envs!r}"
            )
        self.config = config
        self.streams = [SeedStreams.of(seed) for seed in config.seeds]
        num_seeds = len(config.seeds)
        self.envs = make_envs(num_seeds) if make_envs else make_environments(config, num_seeds)
        with contextlib.ExitStack() as on_error:
            on_error.callback(getattr(self.envs, "close", lambda: None))  # no environments may have none
            check_environments(self.envs, num_seeds, config.action_mode)
            box: Any = self.envs.single_action_space
            policy = Policy(config.policy, box.low, box.high)
            self._compiled = compiled_engine(policy.family) if config.engine == "compiled" else None
            obs_dim = gymnasium.spaces.flatdim(self.envs.single_observation_space)
            generators = [stream.initialization for stream in self.streams]
            with one_thread():  # the last bits of orthogonal initial weights depend on the number of threads
                self.networks = ActorCritic(policy, obs_dim, config.network, generators)
            self._algorithm = ALGORITHMS[config.algorithm_name][1]
            make_optimizer, acting = self._algorithm.make_optimizer, None
            if self._compiled is not None:
                acting = self._compiled.CompiledActing(self.networks)
                self.optimizer = self._compiled.SeedBySeed(self.networks, make_optimizer, config.algorithm)
            else:
                self.optimizer = make_optimizer(self.networks, config.algorithm)
            self.collector = Collector(
                self.envs, self.networks, self.streams, config.normalize_obs, config.action_mode, acting
            )
            on_error.pop_all()
        self.rollout: Rollout | None = None
        """What the last epoch learned from."""
        self.records: list[Record] = []
        self.diverged = np.zeros(num_seeds, np.bool_)
        self.fed_nonsense = np.zeros(num_seeds, np.bool_)
        """`[S]` which seeds have diverged in this process because of an observation or a reward that was not finite."""

    def epoch(self) -> Record:
        """Collect one rollout, do one update, and return the record, which also joins `records`."""
        start = time.perf_counter()
        algorithm = self.config.algorithm
        self.rollout = None  # two would take twice the memory
        one_blas_thread = self._compiled.one_blas_thread if self._compiled else contextlib.nullcontext
        with one_thread(), one_blas_thread():
            self.rollout = rollout = self.collector.collect(algorithm.horizon)
            diagnostics = self._update(rollout)
        told = self._mark_diverged(rollout)
        record: Record = {
            "epoch": len(self.records),
            "env_steps": algorithm.horizon * (len(self.records) + 1),
            "seconds": time.perf_counter() - start,
            **episode_statistics(rollout),
            "saturation": rollout.saturation,
            "action_std": rollout.action_std,
            **{name: value.double().numpy() for name, value in diagnostics.items()},
            "diverged": self.diverged.copy(),
        }
        self.records.append(record)
        for each in told:  # when all is kept: who turns it into an error may go on
            warnings.warn(each, DivergedSeedWarning, stacklevel=2)
        return record

    def _update(self, rollout: Rollout) -> dict[str, Tensor]:
        """Do the algorithm's update: all seeds side by side, or under the engine `compiled` one after another."""
        update, algorithm = self._algorithm.update, self.config.algorithm
        shuffles = [stream.shuffle for stream in self.streams]
        if self._compiled is not None:
            return self.optimizer.update(update, rollout, shuffles, algorithm)
        return update(self.networks, self.optimizer, rollout, shuffles, algorithm)

    def _mark_diverged(self, rollout: Rollout) -> list[str]:
        """Mark the seeds whose weights have just ceased to be finite; return the warnings, where that came from."""
        now = ~self.networks.finite().numpy() & ~self.diverged
        finite = rollout.obs.isfinite().all(2) & rollout.reward.isfinite() & rollout.bootstrap.isfinite()
        # [S]; the bootstrap has seen the last observations of rollout and episodes.
        received = finite.all(1).numpy()
        self.fed_nonsense |= now & ~received
        self.diverged |= now
        seeds = np.array(self.config.seeds)
        groups = seeds[now & received].tolist(), seeds[now & ~received].tolist()
        return told_of_divergence(*groups, len(self.records), self.config.network.dtype)

    @property
    def checkpoint_due(self) -> bool:
        """Whether `train` keeps a checkpoint after the epoch that is done: every so many, and at the end."""
        return self.finished or len(self.records) % self.config.checkpoint_every == 0

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or no seed is left to learn in them."""
        return len(self.records) >= self.config.epochs or bool(self.diverged.all())

    @property
    def policies(self) -> list[TrainedPolicy]:
        """What has been learned so far, one policy per seed, ready to act without the trainer."""
        return policies_from(self.config, self.tensors())

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return what the policies are made of, S seeds in the order of the configuration.

        `policy.i.weight` `[S, out, in]`, `policy.i.bias` `[S, out]`, `normalizer.mean` and `normalizer.variance`
        `[S, O]` where the run normalises observations, `action.low` and `action.high` `[A]`, `diverged` `[S]`.
        """
        box: Any = self.envs.single_action_space
        tensors = {n: t.numpy() for n, t in self.networks.actor.named_tensors("policy").items()}
        if (normalizer := self.collector.normalizer) is not None:
            tensors["normalizer.mean"] = normalizer.mean.copy()
            tensors["normalizer.variance"] = normalizer.squares / max(normalizer.count, 1)
        return tensors | {
            "action.low": box.low.copy(),
            "action.high": box.high.copy(),
            "diverged": self.diverged.copy(),
        }

    def state_dict(self) -> dict[str, Any]:
        """Return everything that the future depends on, and the records so far; later epochs leave it as it is."""
        return {
            "config": describe(self.config),
            "networks": self.networks.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "collector": self.collector.state_dict(),
            "shuffle": generator_states([stream.shuffle for stream in self.streams]),
            "records": list(self.records),
            "diverged": self.diverged.copy(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to a state from `state_dict` of a run with the same configuration.

        Raises:
            ValueError: it is of another configuration (but for more epochs) or environment; nothing is loaded then.
        """
        if different := changed_fields(self.config, state["config"], FREE_TO_CHANGE):
            changes = "; ".join(f"{name}: {stored} → {ours}" for name, (stored, ours) in different.items())
            raise ValueError(
                f"the checkpoint belongs to another configuration ({changes}): "
                "use that one, or another run directory"
            )
        self.networks.check_state_dict(state["networks"])
        self.collector.check_state_dict(state["collector"])
        self.collector.load_state_dict(state["collector"])  # first, for the environments may refuse
        self.networks.load_state_dict(state["networks"])
        self.optimizer.load_state_dict(state["optimizer"])
        restore_generators([stream.shuffle for stream in self.streams], state["shuffle"])
        self.records = list(state["records"])
        self.config = dataclasses.replace(self.config, epochs=max(self.config.epochs, len(self.records)))
        self.diverged = state["diverged"].copy()


def train(
    config: TrainConfig,
    *,
    run_dir: str | Path | None = None,
    make_envs: Callable[[int], Environments] | None = None,
    callback: Callable[[Trainer, Record], None] | None = None,
) -> Trainer:
    """Train to the last epoch, going on from the run directory's checkpoint if there is one.

    A resumed run is, bit for bit, the run that was never interrupted, if the environments can save their state
    (`get_state`, `set_state`, as those of `inbounds.robots`); others start new episodes where the run resumes. So do
    wrapped ones: what a wrapper has gathered, such as the statistics of `NormalizeReward`, is not kept.

    Args:
        config: what to do.
        run_dir: where to keep the checkpoint; None keeps none. `save_run(run_dir, trainer)` adds policies and curves.
        make_envs: makes a vector environment (`AutoresetMode.SAME_STEP`) for a number of seeds; None makes
            `config.env`.
        callback: called after every epoch with the trainer and the record: a progress bar, a logger.

    Returns:
        The trainer, its run finished, with `records`, `networks`, `diverged`, `collector`. Its `envs` are open; where
        an error is raised, they are closed.

    Raises:
        ValueError: the run directory is of another configuration, or its checkpoint damaged (`DamagedFileError`).
        TypeError: the environments' state holds what a checkpoint cannot keep.
        BlockingIOError: another process or thread trains in the run directory.
        OSError: run directory or checkpoint cannot be written, as on a full disk; the checkpoint before is kept.

    Warns:
        DivergedSeedWarning: seeds diverge, and where the checkpoint from before is kept; or all of a run have.

    Example:
        >>> from inbounds.learning.config import preset
        >>> run = train(preset("common", "Swimmer-v5", policy="beta", seeds=2, epochs=1))
        >>> run.finished, run.records[0]["diverged"].tolist()
        (True, [False, False])
    """
    folder = None if run_dir is None else Path(run_dir).absolute()  # an environment may change the directory
    trainer = Trainer(config, make_envs)
    with contextlib.ExitStack() as stack, contextlib.ExitStack() as on_error:
        on_error.callback(trainer.envs.close)
        path = None
        if folder is not None:
            stack.enter_context(claimed(folder))
            path = folder / checkpoint.FILE_NAME
            remove_leftovers(path)
            if path.exists():
                trainer.load_state_dict(checkpoint.load(path))
                if trainer.diverged.all() and len(trainer.records) < trainer.config.epochs:
                    told = f"all seeds of the run in {folder} have diverged: nothing is left to train in it"
                    warnings.warn(told, DivergedSeedWarning, stacklevel=2)
            checkpoint.require_keepable(trainer.state_dict())
        while not trainer.finished:
            sound, sane = np.sum(~trainer.diverged), np.sum(~trainer.fed_nonsense)
            record = trainer.epoch()
            if path is not None and path.exists() and np.sum(~trainer.diverged) < sound:
                kept = checkpoint.set_aside(path, record["epoch"])
                mended = f"with the environment mended, rename it to {path.name} to go on"
                slower = "a smaller learning_rate is another configuration, and needs another run_dir"
                advice = mended if np.sum(~trainer.fed_nonsense) < sane else slower
                told = f"{kept} is the last checkpoint before that epoch: {advice}"
                warnings.warn(told, DivergedSeedWarning, stacklevel=2)
            if path is not None and trainer.checkpoint_due:
                checkpoint.save(path, trainer.state_dict())
            if callback is not None:
                callback(trainer, record)
        on_error.pop_all()
    return trainer


def prepare(config: TrainConfig, make_envs: Callable[[int], Environments] | None = None) -> float:
    """Have everything compiled, or loaded, that a run under the engine `compiled` calls; else its first epoch does.

    Args:
        config: of the run.
        make_envs: as `Trainer` takes it.

    Returns:
        How many seconds it took, some ten at first, less than one later where what is compiled can be kept.

    Example:
        >>> from inbounds.learning import TrainConfig
        >>> prepare(TrainConfig("Swimmer-v5")) < 1  # nothing to compile for autograd
        True
    """
    start = time.perf_counter()
    if config.engine == "compiled":
        steps = max(2, config.algorithm.minibatch_size)
        short = dataclasses.replace(config.algorithm, horizon=steps, num_epochs=1)
        trainer = Trainer(dataclasses.replace(config, seeds=config.seeds[:1], algorithm=short), make_envs)
        with contextlib.closing(trainer.envs), warnings.catch_warnings():
            warnings.simplefilter("ignore", DivergedSeedWarning)  # the run itself will speak of its own seeds
            trainer.epoch()
    return time.perf_counter() - start


def make_environments(config: TrainConfig, num_envs: int) -> Environments:
    """Return a vector environment that resets in the step that ends an episode: our robots, or Gymnasium's.

    Args:
        config: names the environment and the action mode.
        num_envs: number of seeds.

    Raises:
        ValueError: one of our robots without its version, which Gymnasium would take for another.
    """
    if config.env.removeprefix("inbounds/") in TASK_NAMES:
        return robots.make(config.env, num_envs, action_mode=config.action_mode)
    if (versioned := f"{config.env.removeprefix('inbounds/')}-v5") in TASK_NAMES:
        raise ValueError(f"{config.env} names no version: ask for {versioned}")
    make = [lambda: gymnasium.make(config.env)] * num_envs
    with naming_the_backend():  # Gymnasium has robots, too
        try:
            return SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)
        except gymnasium.error.Error as error:
            error.add_note(f"For one of your own pass make_envs= beside {config.env!r}, on resuming, too.")
            raise
