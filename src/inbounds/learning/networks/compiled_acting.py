"""What S policies compute in each step, in compiled loops and one after another. Needs numba, the extra `fast`."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.learning.networks import kernels
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.compiling import ReadFromDisk, kept_on_disk
from inbounds.learning.networks.normalizer import RunningNormalizer
from inbounds.learning.networks.perceptron import Mlp


class CompiledActing:
    """The two networks of each seed, and its statistics, step by step.

    Args:
        networks: of S seeds.
    """

    def __init__(self, networks: ActorCritic) -> None:
        self.policy, self.value = map(_Outputs, networks.networks)

    def see(self, normalizer: RunningNormalizer, obs: NDArray[Any]) -> NDArray[Any]:
        """Take observations `[S, O]` into the statistics, and return them normalised, as the normaliser itself does."""
        normalizer.count += 1
        seen = np.empty(obs.shape, normalizer.dtype)
        obs = np.ascontiguousarray(obs, np.float64)
        _see()(obs, normalizer.count, normalizer.mean, normalizer.squares, seen)
        return seen


class _Outputs:
    """A network's outputs `[S, out]` for one observation per seed `[S, O]`."""

    def __init__(self, network: Mlp) -> None:
        self._rows = network.padded.numpy()  # [S, P]
        self._sizes = np.array(network.sizes)
        self._units = np.empty((2, max(network.sizes)), self._rows.dtype)

    def __call__(self, obs: NDArray[Any]) -> NDArray[Any]:
        out = np.empty((len(self._rows), self._sizes[-1]), self._rows.dtype)
        _outputs()(self._rows, self._sizes, obs, self._units, out)
        return out


def make_outputs() -> Any:
    """Return `kernels.outputs`, to be compiled."""
    return kept_on_disk(kernels.outputs)


def make_see() -> Any:
    """Return `kernels.see`, to be compiled."""
    return kept_on_disk(kernels.see, fast=())


_outputs = functools.cache(functools.partial(ReadFromDisk, make_outputs))
_see = functools.cache(functools.partial(ReadFromDisk, make_see))
