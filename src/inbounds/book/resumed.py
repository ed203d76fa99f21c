"""Stored policies that act, and learn, again: for chapters that do something to a policy of the study.

The study keeps policies and no critics. `resumed` gives a trainer that holds a cell's policies, `learn_values` gives it
critics.
"""

from __future__ import annotations

import torch

from inbounds.learning import Trainer
from inbounds.learning.networks import SeedAdam
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.running.play_ways import run_with_policies

FOREVER = 10**9
"""Observations that the statistics count for, so that new ones do not move them."""
GAMMA = 0.99
"""The study's discount per step."""


def resumed(outcomes: Outcomes, outcome: Outcome) -> Trainer:
    """Return a trainer that holds a cell's final policies, all that are kept, with their statistics of observations.

    Its critics know nothing yet, and its optimiser is new.

    Args:
        outcomes: where the cell was found.
        outcome: of the cell.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> outcomes = Outcomes.read(StudyFolder())  # in the project's folder
        >>> trainer = resumed(outcomes, outcomes.finished["standard-hopper-ppo-logit-normal"])
        >>> len(trainer.policies)
        10
    """
    trainer = run_with_policies(outcome.cell, outcomes.folder, count=FOREVER, engine="autograd")
    trainer.collector.restart()  # the first observations, as these statistics show them
    return trainer


def learn_values(trainer: Trainer, rounds: int = 2, steps: int = 120, horizon: int = 4096) -> None:
    """Let a trainer's critics learn the rewards to go of its policies, which stay as they are.

    Args:
        trainer: changed in place.
        rounds: rollouts, each of which a later one may bootstrap from.
        steps: of Adam for each, on minibatches of 1024.
        horizon: steps of a rollout.
    """
    networks = trainer.networks
    adam, head = SeedAdam([networks.critic], 3e-3, eps=1e-5, max_grad_norm=None), networks.critic.layers[-1]
    random = torch.Generator().manual_seed(0)
    for k in range(rounds):
        rollout = trainer.collector.collect(horizon)
        _, target = rollout.advantages(GAMMA, gae_lambda=1.0)
        centre, unit = target.mean(1, keepdim=True), target.std(1, keepdim=True)
        if k == 0:  # in the unit of the returns, or the regression would take forever to get there
            with torch.no_grad():
                head.weight.mul_(unit[..., None])
                head.bias[..., 0] = centre
        for _ in range(steps):
            some = torch.randperm(horizon, generator=random)[:1024]
            error = (networks.values(rollout.obs[:, some]) - target[:, some]) / unit
            adam.minimize(error.square().mean(1).sum())
