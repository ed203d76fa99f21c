"""What the files of a run say of themselves: its configuration, and what it ran on."""

from __future__ import annotations

import contextlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from inbounds.learning.config import ALGORITHMS, TrainConfig
from inbounds.learning.families.family import Limits
from inbounds.learning.families.policy import PolicyConfig
from inbounds.learning.networks.actor_critic import NetworkConfig
from inbounds.learning.storage.stored_config import describe

METADATA_KEY = "inbounds"
FORMAT = 1
PACKAGES = ("gymnasium", "inbounds", "mujoco", "numpy", "scipy", "torch")
COMPILERS = ("llvmlite", "numba")
"""They decide the bits of a result of the engine `compiled`, and are not always there."""


def metadata_of(config: TrainConfig, **more: str) -> str:
    """Return the configuration, and what it ran on, as JSON.

    Args:
        config: of the run.
        **more: further entries.
    """
    return json.dumps({"format": FORMAT, "config": describe(config), "versions": versions()} | more)


def parsed(metadata: str | bytes | None) -> dict[str, Any]:
    """Return what a file says of itself, from the words that it keeps under `METADATA_KEY`.

    Raises:
        ValueError: it says nothing; other software wrote it, or what it said was lost on the way.

    Example:
        >>> parsed('{"id": "ours"}')
        {'id': 'ours'}
    """
    found = json.loads(metadata or "null")
    if not isinstance(found, dict):
        raise ValueError("it does not say where it comes from: inbounds did not write it, or that was lost")
    return found


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide the bits of a result."""
    found = {"python": platform.python_version()} | {name: version(name) for name in PACKAGES}
    for name in COMPILERS:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def config_from(metadata: Mapping[str, Any]) -> TrainConfig:
    """Return the configuration from `metadata_of`, parsed.

    Args:
        metadata: the parsed JSON.

    Raises:
        ValueError: it is of no run, of a format that is no number, or another version of the package wrote it, with
            options or values that this one does not know.

    Example:
        >>> from inbounds.learning import preset
        >>> config = preset("as-printed", policy="beta", algo="trpo", seeds=[3, 5])
        >>> config_from(json.loads(metadata_of(config))) == config
        True
    """
    if not {"format", "config"} <= metadata.keys():
        raise ValueError("the file is of no run: it has no configuration of one")
    if not isinstance(metadata["format"], int | float):
        raise ValueError(
            f"the file has format {metadata['format']!r}, which is no number: inbounds did not write it"
        )
    if metadata["format"] > FORMAT:
        raise ValueError(f"the file has format {metadata['format']}: update inbounds to read it")
    try:
        return _rebuilt(metadata["config"])
    except (KeyError, TypeError, ValueError) as error:
        writer = metadata.get("versions", {}).get("inbounds", "unknown")
        raise ValueError(
            f"inbounds {writer} wrote the file, with a configuration that this version cannot read ({error}): "
            "read it with that one, or update inbounds"
        ) from error


def _rebuilt(config: Mapping[str, Any]) -> TrainConfig:
    values = dict(config)
    policy, network = dict(values["policy"]), dict(values["network"])
    algorithm = ALGORITHMS[values.pop("algorithm_name")][0]
    return TrainConfig(
        **values
        | {
            "seeds": tuple(values["seeds"]),
            "algorithm": algorithm(**values["algorithm"]),
            "policy": PolicyConfig(**policy | {"limits": Limits(**policy["limits"])}),
            "network": NetworkConfig(**network | {"hidden_sizes": tuple(network["hidden_sizes"])}),
        }
    )
