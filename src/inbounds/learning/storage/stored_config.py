"""Whether a stored configuration is the one that the engine would run now.

A later engine may have options that a stored configuration does not name. Their defaults keep the old behaviour, or
else results change and a new study version is due; so an option that is not named there had its default.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from inbounds.learning.config import TrainConfig

FREE_TO_CHANGE = ("epochs", "checkpoint_every")
"""What a run may be continued with that it was not begun with."""

_NO_DEFAULT = object()


def describe(config: TrainConfig) -> dict[str, Any]:
    """Return a configuration as nested plain dictionaries, the algorithm's name included."""
    return {**_native(dataclasses.asdict(config)), "algorithm_name": config.algorithm_name}


def _native(tree: Any) -> Any:
    """Return a tree with Python's numbers in the place of NumPy's, which JSON does not know."""
    if isinstance(tree, np.generic):
        return tree.item()
    if isinstance(tree, dict):
        return {name: _native(value) for name, value in tree.items()}
    return type(tree)(map(_native, tree)) if isinstance(tree, list | tuple) else tree


def changed_fields(
    config: TrainConfig, stored: Mapping[str, Any], free: Collection[str] = ("checkpoint_every",)
) -> dict[str, tuple[Any, Any]]:
    """Return the options in which a stored configuration differs from one of today.

    Args:
        config: of today.
        stored: `describe` of another time, perhaps by way of JSON.
        free: options that decide no result.

    Returns:
        By their dotted names, as "algorithm.gamma", what is stored and what is asked for; "absent" where one side
        does not know the option.

    Example:
        >>> from inbounds.learning import preset
        >>> config = preset("common", "Hopper-v5")
        >>> stored = describe(config) | {"normalize_obs": False}
        >>> changed_fields(config, stored)
        {'normalize_obs': (False, True)}
    """
    ours = {name: value for name, (value, _) in _options(config).items()}
    defaults = {name: default for name, (_, default) in _options(config).items()}
    theirs = _leaves(stored)
    pairs = {
        name: (theirs.get(name, defaults.get(name, _NO_DEFAULT)), ours.get(name, _NO_DEFAULT))
        for name in dict.fromkeys([*ours, *theirs])
        if name not in free
    }
    return {
        name: ("absent" if there is _NO_DEFAULT else there, "absent" if here is _NO_DEFAULT else here)
        for name, (there, here) in pairs.items()
        if there != here
    }


def _options(config: TrainConfig) -> dict[str, tuple[Any, Any]]:
    """Values and defaults of all options, by their dotted names."""
    found: dict[str, tuple[Any, Any]] = {"algorithm_name": (config.algorithm_name, _NO_DEFAULT)}

    def walk(value: Any, prefix: str) -> None:
        for option in dataclasses.fields(value):
            name, here = prefix + option.name, getattr(value, option.name)
            if dataclasses.is_dataclass(here):
                walk(here, f"{name}.")
            else:
                found[name] = _plain(here), _default(option)

    walk(config, "")
    return found


def _default(option: dataclasses.Field[Any]) -> Any:
    if option.default is not dataclasses.MISSING:
        return _plain(option.default)
    if option.default_factory is not dataclasses.MISSING:
        return _plain(option.default_factory())
    return _NO_DEFAULT


def _leaves(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in values.items():
        found |= (
            _leaves(value, f"{prefix}{name}.")
            if isinstance(value, Mapping)
            else {prefix + name: _plain(value)}
        )
    return found


def _plain(value: Any) -> Any:
    """As JSON gives it back: tuples are lists there."""
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
