"""The floor: what a run cannot do without, were everything else free.

* *Physics.* `Batch.step` on one thread, replaying states and controls that a run of this engine recorded, contact
  forces included where the task feels them.
* *Arithmetic.* The floating-point operations of the networks (`work.flops_per_step`) at the rate of a large float32
  matrix product on this core: a rate that products of 64 × 64 do not reach.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.contestants import inbounds_config
from benchmarks.work import Work, flops_per_step, stopwatch

MATMUL_SIZE = 768  # rows and columns: three such matrices fill most of a core's share of the cache


class Recorder:
    """Stands before a vector environment and keeps the physics of every step."""

    def __init__(self, envs: Any) -> None:
        self.envs = envs
        self.physics: list[np.ndarray] = []

    def step(self, actions: np.ndarray) -> Any:
        """Note the state before the step, `[S, n]`, and pass it on."""
        self.physics.append(self.envs.get_state()["physics"])
        return self.envs.step(actions)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.envs, name)


class Floor:
    """The physics of one recorded epoch, ready to be replayed, and a pair of matrices.

    Args:
        work: what the contestants do.
        num_seeds: robots in the batch.
    """

    def __init__(self, work: Work, num_seeds: int = 10) -> None:
        import torch
        from mujoco.batch import Batch

        from inbounds.learning import Trainer
        from inbounds.robots.vector_env import TASKS

        torch.set_num_threads(1)
        trainer = Trainer(inbounds_config(work, "ppo", num_seeds, "gaussian"))
        trainer.epoch()  # the states of a policy that has learned a little
        recorder = Recorder(trainer.envs)
        trainer.collector.envs = recorder
        rollout = trainer.collector.collect(work.horizon)
        self.states = np.stack(recorder.physics)  # [T, S, n]
        self.controls = rollout.action.numpy().swapaxes(0, 1).copy()  # [T, S, A]
        kind = TASKS[work.env]
        self._batch = Batch(kind.load_model(), num_seeds, 1, persistent=kind.feels_contacts)
        self._task = kind(self._batch)
        self.num_steps = num_seeds * work.horizon
        self.flops_per_step = flops_per_step(work, rollout.obs.shape[-1], rollout.action.shape[-1])
        self._a = torch.randn(MATMUL_SIZE, MATMUL_SIZE)
        self._product = torch.empty_like(self._a)

    def replay(self) -> dict[str, float]:
        """Return the seconds that the physics of the recorded epoch takes."""
        batch, task, stop = self._batch, self._task, stopwatch()
        for state, control in zip(self.states, self.controls, strict=True):
            batch.state[:] = state
            task.ctrl[:] = control
            batch.step(nstep=task.frame_skip)
            task.feel_contacts()
        return stop()

    def multiply(self, count: int = 40) -> dict[str, float]:
        """Return the seconds that the arithmetic of the epoch would take, at the rate of large matrix products."""
        import torch

        stop = stopwatch()
        for _ in range(count):
            torch.mm(self._a, self._a, out=self._product)
        share = self.num_steps * self.flops_per_step / (count * 2 * MATMUL_SIZE**3)
        return {clock: share * seconds for clock, seconds in stop().items()}

    def turn(self) -> dict[str, float]:
        """Return one measurement: physics and arithmetic, one after the other."""
        physics, arithmetic = self.replay(), self.multiply()
        return {
            "steps": self.num_steps,
            **{clock: physics[clock] + arithmetic[clock] for clock in physics},
            "physics_seconds": physics["seconds"],
            "flops": self.num_steps * self.flops_per_step,
            "flops_per_second": self.num_steps * self.flops_per_step / arithmetic["seconds"],
        }
