"""Checkpoints that are whole or absent: written beside the old one, then renamed over it."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from inbounds.learning.storage.whole_files import damaged, says_nothing_of_the_file, write_whole

FILE_NAME = "checkpoint.pt"
_PLAIN = (bool, int, float, complex, str, bytes, type(None))
"""Kept as they are, but no subclass of them: to read an enumeration's member is to execute what made it."""


def save(path: Path, state: dict[str, Any]) -> None:
    """Write a state so that `path` always holds a complete one, whenever the process or the machine dies.

    Args:
        path: of the file; its folder must exist.
        state: nested dictionaries, lists, tuples, sets, numbers, strings, tensors and NumPy arrays.

    Raises:
        TypeError: it holds something else, which could not be read again; the old file is untouched.
        OSError: it could not be written, as on a full disk; the old file is untouched.
    """
    buffer = io.BytesIO()
    torch.save(_to_tensors(state), buffer)
    write_whole(path, buffer.getbuffer())


def set_aside(path: Path, epoch: int) -> Path:
    """Keep a checkpoint under a name that no later one takes: the state of a run before an epoch that went wrong.

    Args:
        path: of the checkpoint.
        epoch: which.

    Returns:
        Where it is kept.

    Raises:
        OSError: it could not be written, as on a full disk; the checkpoint is untouched.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save(Path(folder, FILE_NAME), {"records": []})
        ...     set_aside(Path(folder, FILE_NAME), 7).name
        'checkpoint-before-epoch-7.pt'
    """
    kept = path.with_name(f"{path.stem}-before-epoch-{epoch}{path.suffix}")
    write_whole(kept, path.read_bytes())
    return kept


def require_keepable(state: dict[str, Any]) -> None:
    """Raise a TypeError if `save` would: to be told before hours of training, not after.

    Example:
        >>> require_keepable({"rng": object()})  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        TypeError: a checkpoint cannot keep state['rng'], of type object: let get_state of the environment return ...
    """
    _to_tensors(state)


def load(path: Path) -> dict[str, Any]:
    """Read a state from `save`. Nothing in the file is executed.

    Args:
        path: of the file.

    Returns:
        The state, arrays as arrays.

    Raises:
        DamagedFileError: the file is cut short, damaged, or no checkpoint.
    """
    remedy = (
        f"move {path.parent} out of the way and train again, or put a copy of the checkpoint in its place. "
        "Nothing has been changed"
    )
    try:
        with zipfile.ZipFile(path) as parts:  # torch writes checksums and does not look at them
            bad = parts.testzip()
        state = _to_arrays(torch.load(path, weights_only=True))
    except Exception as error:  # torch raises whatever the damage makes it stumble over
        if says_nothing_of_the_file(error):
            raise
        raise damaged(path, error, remedy) from error
    if bad is not None:
        raise damaged(path, f"the checksum of {bad} is wrong", remedy)
    if not isinstance(state, dict) or not {"config", "networks", "records"} <= state.keys():
        raise damaged(path, "it holds no run", remedy)
    return state


def _to_tensors(tree: Any, place: str = "state") -> Any:
    """Return a tree that `torch.load` reads without executing anything.

    Raises:
        TypeError: it holds something else than numbers, strings, arrays of numbers, and collections of them.
    """
    numbers = isinstance(tree, np.ndarray | np.generic) and tree.dtype.kind in "biufc"
    if numbers and not isinstance(tree, np.ma.MaskedArray):  # whose mask a tensor has not
        native = np.asarray(tree, tree.dtype.newbyteorder("="), order="C")
        kind = "__ndarray__" if isinstance(tree, np.ndarray) else "__number__"
        return {kind: torch.from_numpy(native).clone()}
    if isinstance(tree, dict):
        return {
            _to_tensors(_hashable(key), f"a key of {place}"): _to_tensors(value, f"{place}[{key!r}]")
            for key, value in tree.items()
        }
    if type(tree) is set:
        return {_to_tensors(_hashable(value), f"an element of {place}") for value in tree}
    if isinstance(tree, np.str_ | np.bytes_):
        tree = tree.item()
    if type(tree) in (list, tuple):
        return type(tree)(_to_tensors(value, f"{place}[{i}]") for i, value in enumerate(tree))
    if type(tree) in _PLAIN or isinstance(tree, torch.Tensor):
        return tree
    raise TypeError(
        f"a checkpoint cannot keep {place}, of type {type(tree).__name__}: let get_state of "
        "the environment return numbers, strings, arrays of numbers, and lists, tuples and dictionaries of them (of a "
        "NumPy Generator, its bit_generator.state)"
    )


def _hashable(key: Any) -> Any:
    """Return a key, or a set's element, with a number of NumPy's as Python's, which is equal and has its hash."""
    if type(key) is tuple:
        return tuple(map(_hashable, key))
    return key.item() if isinstance(key, np.generic) else key


def _to_arrays(tree: Any) -> Any:
    if isinstance(tree, dict):
        if tree.keys() == {"__ndarray__"}:
            return tree["__ndarray__"].numpy()
        if tree.keys() == {"__number__"}:  # its type decides how its owner goes on computing
            return tree["__number__"].numpy()[()]
        return {key: _to_arrays(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return type(tree)(_to_arrays(value) for value in tree)
    return tree
