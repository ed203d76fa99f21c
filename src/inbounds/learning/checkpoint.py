"""Checkpoints that are whole or absent: written beside the old one, then renamed over it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import torch

FILE_NAME = "checkpoint.pt"


def save(path: Path, state: dict[str, Any]) -> None:
    """Write a state so that `path` always holds a complete one, whenever the process or the machine dies.

    Args:
        path: of the file; its folder must exist.
        state: nested dictionaries, lists, tuples, numbers, strings, tensors and NumPy arrays.
    """
    temporary = path.with_suffix(".partial")
    with open(temporary, "wb") as file:
        torch.save(_to_tensors(state), file)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def load(path: Path) -> dict[str, Any]:
    """Read a state from `save`. Nothing in the file is executed.

    Args:
        path: of the file.

    Returns:
        The state, arrays as arrays.
    """
    return _to_arrays(torch.load(path, weights_only=True))


def _to_tensors(tree: Any) -> Any:
    if isinstance(tree, np.ndarray):
        return {"__ndarray__": torch.from_numpy(np.ascontiguousarray(tree)).clone()}
    if isinstance(tree, np.generic):
        return tree.item()
    if isinstance(tree, dict):
        return {key: _to_tensors(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return type(tree)(_to_tensors(value) for value in tree)
    return tree


def _to_arrays(tree: Any) -> Any:
    if isinstance(tree, dict):
        if tree.keys() == {"__ndarray__"}:
            return tree["__ndarray__"].numpy()
        return {key: _to_arrays(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return type(tree)(_to_arrays(value) for value in tree)
    return tree
