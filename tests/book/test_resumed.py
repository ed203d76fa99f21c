"""Stored policies that act again: the same policies, with critics that know something."""

import numpy as np
import pytest

from inbounds.book.report.over_seeds import final_policies
from inbounds.book.resumed import learn_values, resumed
from inbounds.learning import Trainer
from inbounds.study import StudyFolder, select
from inbounds.study.outcomes import Outcomes

CELL = "standard-hopper-ppo-logit-normal"
FEWER_KEPT = "equal-hopper-trpo-beta"
"""A cell that keeps the policies of some of its seeds."""


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return Outcomes.read(StudyFolder(), select([CELL, FEWER_KEPT]))


@pytest.fixture(scope="module")
def trainer(outcomes: Outcomes) -> Trainer:
    return resumed(outcomes, outcomes.finished[CELL])


@pytest.mark.parametrize("cell", [CELL, FEWER_KEPT])
def test_they_are_the_stored_policies(outcomes: Outcomes, cell: str) -> None:
    obs, found = np.random.default_rng(0).normal(size=11), outcomes.finished[cell]
    for ours, stored in zip(resumed(outcomes, found).policies, final_policies(outcomes, found), strict=True):
        np.testing.assert_allclose(ours.act(obs, "median"), stored.act(obs, "median"), rtol=1e-4, atol=1e-6)


def test_critics_learn_the_rewards_to_go_and_policies_stay(trainer: Trainer) -> None:
    before, mean = trainer.networks.actor.theta.clone(), trainer.collector.normalizer.mean.copy()
    learn_values(trainer, rounds=2, steps=60, horizon=2048)
    assert trainer.networks.actor.theta.equal(before)
    np.testing.assert_allclose(trainer.collector.normalizer.mean, mean, rtol=1e-4, atol=1e-4)
    rollout = trainer.collector.collect(1024)
    _, target = rollout.advantages(0.99, 1.0)
    left = (target - rollout.value).var(1) / target.var(1)
    assert float(left.median()) < 0.5
