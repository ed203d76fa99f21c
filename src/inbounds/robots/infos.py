"""The layout of a vector environment's info: each key comes with a mask of the robots that it is about."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Info = dict[str, Any]


def masked(info: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> Info:
    """Put a mask `[N]` beside each value `[N, …]`, under the same key with a leading underscore.

    Example:
        >>> masked({"x_position": np.zeros(2)}, np.array([True, False]))
        {'x_position': array([0., 0.]), '_x_position': array([ True, False])}
    """
    return {
        key: value for name, values in info.items() for key, value in ((name, values), (f"_{name}", mask))
    }


def only(mask: NDArray[np.bool_], info: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Keep the values of the robots in the mask, zero elsewhere; nothing if the mask is empty.

    Example:
        >>> only(np.array([True, False]), {"x_position": np.ones(2)})
        {'x_position': array([1., 0.])}
    """
    if not mask.any():
        return {}
    return {
        key: np.where(mask, values.T, 0).T for key, values in info.items()
    }  # .T: the mask is along axis 0
