"""The book's central theorem, run: under a fixed bijection of the action nothing changes but the map."""

import pytest
import torch

from inbounds.distributions import LogitNormal
from inbounds.learning import Trainer
from inbounds.learning.families import NormalLaw, NormalParameters
from tests.learning.point import PointEnv
from tests.learning.small import ALGORITHMS, small_config, small_run, weights


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_logit_normal_is_gaussian_behind_an_independent_sigmoid(algo: str, dtype: str) -> None:
    """The wrapped world squashes what a raw Gaussian sends. Parameter trajectories are equal to the last bit."""
    options = {"entropy_coef": 0.0, "dtype": dtype, "epochs": 3}
    ours = small_run(small_config(algo, "logit-normal", **options), dtype=dtype)
    theirs = small_run(small_config(algo, "gaussian", action_mode="raw", **options), dtype=dtype, squash=True)
    assert torch.equal(weights(ours), weights(theirs))
    for a, b in zip(ours.records, theirs.records, strict=True):
        assert (a["return_mean"] == b["return_mean"]).all()
        assert (a["kl"] == b["kl"]).all()


def test_what_is_not_invariant_is_the_entropy() -> None:
    options = {"entropy_coef": 1e-2, "dtype": "float64"}
    ours = small_run(small_config("ppo", "logit-normal", **options))
    theirs = small_run(small_config("ppo", "gaussian", action_mode="raw", **options), squash=True)
    assert not torch.allclose(weights(ours), weights(theirs), rtol=1e-6)


class ActionSpaceLaw(NormalLaw):
    """Scores the action, by the public density; latents only carry it there."""

    def log_prob(self, parameters: NormalParameters, latent: torch.Tensor) -> torch.Tensor:
        law = LogitNormal(parameters.loc, parameters.log_scale.exp(), -1.0, 1.0, validate_args=False)
        return law.log_prob(torch.tanh(latent / 2)).sum(-1)


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_latents_or_actions_it_is_the_same_training(algo: str) -> None:
    config = small_config(algo, "logit-normal", dtype="float64", epochs=3)
    ours = small_run(config)
    theirs = Trainer(config, PointEnv)
    theirs.networks.policy.law = ActionSpaceLaw()
    for _ in range(config.epochs):
        theirs.epoch()
    assert not torch.equal(weights(ours), weights(theirs))  # it did take the other path
    assert torch.allclose(weights(ours), weights(theirs), rtol=1e-6, atol=1e-9)
