"""One seed, four independent streams: what makes a seed's run its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch


@dataclass
class SeedStreams:
    """The generators of one seed. No two seeds share any, so none can tell which others run beside it.

    Args:
        initialization: draws the networks' first weights.
        noise: draws the latents of the actions.
        shuffle: orders the minibatches.
        environment: the integer that the environment is reset with.

    Example:
        >>> a, b = SeedStreams.of(3), SeedStreams.of(3)
        >>> bool(a.noise.random() == b.noise.random()), a.environment == SeedStreams.of(4).environment
        (True, False)
    """

    initialization: torch.Generator
    noise: np.random.Generator
    shuffle: np.random.Generator
    environment: int

    @classmethod
    def of(cls, seed: int) -> SeedStreams:
        """Return the streams of a seed, a non-negative integer."""
        initialization, noise, shuffle, environment = np.random.SeedSequence(seed).spawn(4)
        return cls(
            torch.Generator().manual_seed(int(initialization.generate_state(1, np.uint64)[0] >> 1)),
            np.random.default_rng(noise),
            np.random.default_rng(shuffle),
            int(environment.generate_state(1)[0]),
        )


def generator_states(generators: Sequence[np.random.Generator]) -> list[dict[str, Any]]:
    """Return the states of NumPy generators, as plain dictionaries."""
    return [dict(generator.bit_generator.state) for generator in generators]


def restore_generators(generators: Sequence[np.random.Generator], states: Sequence[dict[str, Any]]) -> None:
    """Set NumPy generators to states from `generator_states`."""
    for generator, state in zip(generators, states, strict=True):
        generator.bit_generator.state = state
