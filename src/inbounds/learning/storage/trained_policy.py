"""A policy after training: observations in, actions out, in NumPy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import nn
from torch.distributions import Distribution

from inbounds.learning.config import TrainConfig
from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.normalizer import RunningNormalizer
from inbounds.learning.networks.perceptron import Mlp
from inbounds.learning.storage.deployed import DeployedPolicy


class TrainedPolicy:
    """The policy of one seed, frozen: its network, the statistics of its observations, its box.

    Args:
        config: of the run.
        seed: which of the run's seeds.
        diverged: whether its weights are not finite.
        network: of one seed.
        normalizer: of one seed; None where the run does not normalise observations.
        low: `[A]` lower bounds of the action, in the robot's units.
        high: `[A]` upper bounds.

    Example:
        >>> import numpy as np
        >>> from inbounds.learning import Trainer, preset
        >>> policy = Trainer(preset("common", "Hopper-v5", seeds=2)).policies[1]
        >>> policy.act(np.zeros(11)).shape, policy.act(np.zeros((5, 11)), "sample").shape
        ((3,), (5, 3))
    """

    def __init__(
        self,
        config: TrainConfig,
        seed: int,
        diverged: bool,
        network: Mlp,
        normalizer: RunningNormalizer | None,
        low: NDArray[Any],
        high: NDArray[Any],
    ) -> None:
        self.config, self.seed, self.diverged = config, seed, diverged
        self.low, self.high = low, high
        self._network, self._normalizer = network, normalizer
        self._policy = Policy(config.policy, low, high)
        self._dtype = np.dtype(config.network.dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a policy be copied, and pickled for another process."""
        parts = self.config, self.seed, self.diverged, self._network, self._normalizer, self.low, self.high
        return type(self), parts

    @classmethod
    def from_tensors(
        cls, config: TrainConfig, tensors: Mapping[str, NDArray[Any]], index: int
    ) -> TrainedPolicy:
        """Take one seed out of the tensors of a run (`inbounds.learning.Trainer.tensors` names them).

        Args:
            config: of the run.
            tensors: by name, S in front.
            index: which seed, 0 the first of the run.
        """
        depth = len(config.network.hidden_sizes) + 1
        weights = [tensors[f"policy.{i}.weight"][index] for i in range(depth)]  # [out, in] each
        sizes = (weights[0].shape[1], *(weight.shape[0] for weight in weights))
        network = Mlp(1, sizes, getattr(torch, config.network.dtype))
        with torch.no_grad():
            for i, (layer, weight) in enumerate(zip(network.layers, weights, strict=True)):
                layer.weight[0] = torch.from_numpy(weight)
                layer.bias[0, :, 0] = torch.from_numpy(tensors[f"policy.{i}.bias"][index])
        normalizer = None
        if config.normalize_obs:
            normalizer = RunningNormalizer(1, sizes[0], config.network.dtype)
            normalizer.count = 1  # a variance is a mean of squares already
            normalizer.mean[0] = tensors["normalizer.mean"][index]
            normalizer.squares[0] = tensors["normalizer.variance"][index]
        low, high = tensors["action.low"], tensors["action.high"]
        return cls(
            config, config.seeds[index], bool(tensors["diverged"][index]), network, normalizer, low, high
        )

    def __repr__(self) -> str:
        what = (
            f"{self.config.policy.family}, {self.config.algorithm_name}, {self.config.env}, seed {self.seed}"
        )
        return f"<TrainedPolicy: {what}{', diverged' if self.diverged else ''}>"

    @property
    def greedy_choices(self) -> tuple[str, ...]:
        """Ways to act: what the family offers of mean, median and mode, and sample."""
        return (*self._policy.family.greedy, "sample")

    def act(
        self, obs: ArrayLike, greedy: str = "median", rng: np.random.Generator | int | None = None
    ) -> NDArray[Any]:
        """Return actions for observations, both as the environment has them.

        Args:
            obs: `[O]` or `[B, O]`, flattened where one observation has several axes.
            greedy: "mean", "median", "mode" or "sample", of `greedy_choices`. Of the first three the median alone is
                left in place by a change of variables.
            rng: where "sample" draws from, or the seed of it; None is a generator seeded by the system.

        Returns:
            `[A]` or `[B, A]`, in the robot's units, within the box (a sample under `action_mode="raw"` may leave it);
            the middle of the box from a diverged policy.

        Raises:
            ValueError: observations of another size or not finite, or a greedy action that the family
                does not offer.
        """
        seen, shape = self._seen(obs)
        self._require(greedy, self.greedy_choices)
        if self.diverged or not len(seen):  # a part of a diverged policy's weights may be finite
            return np.broadcast_to(self._policy.centre.astype(self._policy.dtype), shape).copy()
        outputs = self._network.act(seen)
        if greedy == "sample":
            rng = np.random.default_rng(rng)
            action = self._policy.sample(outputs, [rng] * len(outputs), self.config.action_mode)
        else:
            action = self._policy.greedy(torch.from_numpy(outputs), greedy)
        return action.reshape(shape)

    def distribution(self, obs: ArrayLike) -> Distribution:
        """Return the distribution of the action in each state: its parameters, its density, its samples, in torch.

        Args:
            obs: `[O]` or `[B, O]`, as the environment has them.

        Returns:
            `torch.distributions.Normal`, or `ClippedNormal`, `ScaledBeta` or `LogitNormal` of
            `inbounds.distributions`, by the family: `[A]` or `[B, A]`, elementwise, in the robot's units, float64.
            For `gaussian` the Normal that is drawn from, before any clip.

        Raises:
            ValueError: observations of another size or not finite, or a policy that has diverged.

        Example:
            >>> import numpy as np
            >>> from inbounds.learning import Trainer, preset
            >>> policy = Trainer(preset("common", "Hopper-v5", seeds=1)).policies[0]
            >>> law = policy.distribution(np.zeros((5, 11)))
            >>> type(law).__name__, tuple(law.scale.shape), tuple(law.log_prob(law.sample()).sum(-1).shape)
            ('LogitNormal', (5, 3), (5,))
        """
        if self.diverged:
            raise ValueError(
                "the policy has diverged: it has no distribution, and holds the middle of its box"
            )
        seen, shape = self._seen(obs)
        outputs = self._network.act(seen)
        return self._policy.distribution(torch.from_numpy(outputs).reshape(*shape[:-1], outputs.shape[-1]))

    def module(self, greedy: str = "median") -> nn.Module:
        """Return the policy as a PyTorch module for `torch.export` and ONNX, to run where `inbounds` is not.

        It takes observations `[B, O]` as the environment has them, normalises them itself, and returns actions
        `[B, A]` in the robot's units: those of `act`, to rounding. Nothing warns there of an observation that is NaN.

        Args:
            greedy: "median", or "mean" or "mode", as the family offers; a Beta's median is none of PyTorch's, and
                ONNX has the median of the others and the mean of a Beta.

        Raises:
            ValueError: the policy has diverged, or the family does not offer that greedy action, or not as a module.

        Example:
            >>> import numpy as np
            >>> import torch
            >>> from inbounds.learning import Trainer, preset
            >>> policy = Trainer(preset("common", "Hopper-v5", seeds=1)).policies[0]
            >>> module, obs = policy.module(), torch.rand(5, 11)
            >>> batch = {0: torch.export.Dim("batch", min=1, max=1024)}  # else five at a time, for ever
            >>> deployed = torch.export.export(module, (obs,), dynamic_shapes=(batch,)).module()
            >>> bool(np.abs(deployed(obs[:1]).numpy() - policy.act(obs[:1])).max() < 1e-6)
            True
        """
        if self.diverged:
            raise ValueError("the policy has diverged: there is nothing to deploy; take another seed")
        self._require(greedy, self.greedy_choices[:-1])
        normalizer = self._normalizer
        statistics = None if normalizer is None else (normalizer.mean[0], normalizer.std[0])
        return DeployedPolicy(self._policy, self._network.layers, statistics, greedy).eval()

    def _require(self, greedy: str, choices: Sequence[str]) -> None:
        if greedy not in choices:
            raise ValueError(
                f"{self.config.policy.family} does not act by {greedy!r}: choose one of {', '.join(choices)}"
            )

    def _seen(self, obs: ArrayLike) -> tuple[NDArray[Any], tuple[int, ...]]:
        """Return what the network sees, `[B, O]` (the weights of one seed serve every row), and the actions' shape."""
        obs, size = np.asarray(obs), self._network.sizes[0]
        if obs.ndim not in (1, 2) or obs.shape[-1] != size:
            raise ValueError(
                f"observations must have the shape [{size}] or [B, {size}], got {list(obs.shape)}: flatten what has "
                f"more axes, by obs.reshape(-1) or obs.reshape(-1, {size})"
            )
        batch = np.atleast_2d(obs)  # [B, O]
        with np.errstate(over="ignore", invalid="ignore"):  # said below
            seen = batch.astype(self._dtype) if self._normalizer is None else self._normalizer(batch)
        if not (np.isfinite(obs).all() and np.isfinite(seen).all()):
            raise ValueError(
                "an observation is NaN or infinite, and there is no action for that: look at the sensor, or at the "
                "environment, that it came from"
            )
        return seen, (*obs.shape[:-1], len(self.low))


def policies_from(config: TrainConfig, tensors: Mapping[str, NDArray[Any]]) -> list[TrainedPolicy]:
    """Return the policies in the tensors of a run, one per seed."""
    return [TrainedPolicy.from_tensors(config, tensors, i) for i in range(len(config.seeds))]
