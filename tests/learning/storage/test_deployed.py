"""A trained policy as a module of PyTorch acts as the policy does, with its normaliser, its limits and its box."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from inbounds.learning import TrainedPolicy
from inbounds.learning.families.policy import FAMILIES
from tests.learning.small import rng, small_config, small_run

BATCH = {0: torch.export.Dim("batch", min=1, max=1024)}
WAYS = [(name, way) for name, family in FAMILIES.items() for way in family.greedy]
DEPLOYED = [pair for pair in WAYS if pair != ("beta", "median")]


def trained(family: str, dtype: str = "float32", normalize_obs: bool = True) -> TrainedPolicy:
    config = small_config("ppo", family, dtype=dtype, normalize_obs=normalize_obs, seeds=2)
    return small_run(config).policies[1]


def states(policy: TrainedPolicy) -> NDArray[np.float64]:
    """Observations `[7, O]`, some far from all that the statistics know."""
    size = policy._network.sizes[0]
    return rng().normal(size=(7, size)) * np.logspace(-1, 4, 7)[:, None]


@pytest.mark.parametrize(("family", "way"), DEPLOYED)
def test_an_exported_module_acts_as_the_policy(family: str, way: str) -> None:
    policy = trained(family)
    obs = states(policy)
    exported = torch.export.export(policy.module(way), (torch.from_numpy(obs),), dynamic_shapes=(BATCH,))
    deployed = exported.module()
    for batch in (obs, obs[2:3]):
        actions = deployed(torch.from_numpy(batch)).numpy()
        expected = policy.act(batch, way)
        assert actions.dtype == expected.dtype
        assert np.abs(actions - expected).max() < 1e-6 * (policy.high - policy.low).max()
        assert (actions >= policy.low).all()
        assert (actions <= policy.high).all()
    if way == ("mean" if family == "beta" else "median"):
        assert "nextafter" not in str(exported.graph)  # ONNX has no such operator


@pytest.mark.parametrize("normalize_obs", [True, False])
def test_double_weights_and_observations_as_they_come(normalize_obs: bool) -> None:
    policy = trained("logit-normal", "float64", normalize_obs)
    obs = states(policy)
    assert np.abs(policy.module()(torch.from_numpy(obs)).numpy() - policy.act(obs)).max() < 1e-6


def test_it_is_a_copy_and_frozen() -> None:
    policy = trained("gaussian")
    obs = states(policy)
    module = policy.module()
    before = policy.act(obs)
    assert not any(parameter.requires_grad for parameter in module.parameters())
    for parameter in module.parameters():
        parameter.zero_()
    assert (policy.act(obs) == before).all()


def test_what_cannot_be_deployed() -> None:
    policy = trained("beta")
    with pytest.raises(ValueError, match=r"take the mean, module\('mean'\)"):
        policy.module()
    with pytest.raises(ValueError, match="does not act by 'sample': choose one of mean, median, mode"):
        policy.module("sample")
    policy.diverged = True
    with pytest.raises(ValueError, match="the policy has diverged"):
        policy.module("mean")
