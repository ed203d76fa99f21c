"""The floor: what a run cannot do without, were everything else free.

* *Physics.* `Batch.step` on one thread, replaying states and controls that a run of this engine recorded, contact
  forces included where the task feels them.
* *Arithmetic.* The floating-point operations of the networks (`work.flops_per_step`) at the rate of a large float32
  matrix product on this core: a rate that products of 64 × 64 do not reach.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.contestants import inbounds_config
from benchmarks.work import Work, flops_per_step

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
        trainer.collector.envs = recorder  # type: ignore[assignment]
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

    def replay(self) -> float:
        """Return the seconds that the physics of the recorded epoch takes."""
        batch, task = self._batch, self._task
        start = time.perf_counter()
        for state, control in zip(self.states, self.controls, strict=True):
            batch.state[:] = state
            task.ctrl[:] = control
            batch.step(nstep=task.frame_skip)
            task.feel_contacts()
        return time.perf_counter() - start

    def matmul_rate(self, seconds: float = 0.3) -> float:
        """Return the floating-point operations per second of a large float32 matrix product."""
        import torch

        count, start = 0, time.perf_counter()
        while (elapsed := time.perf_counter() - start) < seconds:
            torch.mm(self._a, self._a, out=self._product)
            count += 1
        return count * 2 * MATMUL_SIZE**3 / elapsed

    def turn(self) -> dict[str, float]:
        """Return one measurement."""
        return {
            "steps": self.num_steps,
            "physics_seconds": self.replay(),
            "flops_per_step": self.flops_per_step,
            "flops_per_second": self.matmul_rate(),
        }
