"""Which action spaces a bounded law fits, and what makes the others fit."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["require_box"]


def require_box(space: Any) -> None:
    """Raise unless a policy of bounded actions can act in a Gymnasium space.

    Args:
        space: the action space of one environment.

    Raises:
        ValueError: it is no one-dimensional Box of real numbers whose every component has finite bounds and some room
            between them; the message names the wrapper that makes one.

    Example:
        >>> import gymnasium
        >>> require_box(gymnasium.spaces.Box(-1.0, 1.0, (2,)))
        >>> require_box(gymnasium.spaces.Box(-np.inf, np.inf, (2,)))  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ValueError: actions must have finite bounds, got Box(-inf, inf, (2,), float32): choose some, ...
    """
    if remedy := _remedy(space):
        rule, advice = remedy
        raise ValueError(f"actions must {rule}, got {space}: {advice}")


def _remedy(space: Any) -> tuple[str, str] | None:
    """Return the rule that a space breaks, and what to do about it; None where it breaks none."""
    import gymnasium  # here, because the laws themselves do without it

    wrapped = "gymnasium.wrappers.TransformAction(env, {}, box), where box is {}"
    if not isinstance(space, gymnasium.spaces.Box):
        made = wrapped.format(
            "function", "a bounded, one-dimensional Box and function makes your action of its"
        )
        return "be points of a bounded, one-dimensional Box", f"wrap the environment in {made}"
    if not np.issubdtype(space.dtype, np.floating):
        made = wrapped.format(
            f"lambda action: np.rint(action).astype(np.{space.dtype})",
            "the same Box of floating-point numbers",
        )
        return "be real numbers", f"they would be cut off at the point; to round them, use {made}"
    if len(space.shape) != 1:
        made = wrapped.format(f"lambda action: action.reshape({space.shape})", "the same Box, flattened")
        return "be a one-dimensional Box", f"wrap the environment in {made}"
    if not space.shape[0]:
        return (
            "be a Box with at least one component",
            "there is nothing to decide: check what the environment declares",
        )
    if not space.is_bounded():
        made = wrapped.format("lambda action: action", "a bounded one")
        return "have finite bounds", f"choose some, and wrap the environment in {made}"
    if not (space.low < space.high).all():
        fixed = np.flatnonzero(~(space.low < space.high))[0]
        made = wrapped.format(
            "lambda action: np.clip(action, low, high)", f"one with room in component {fixed}"
        )
        return (
            "have low below high",
            f"component {fixed} has no room; with low, high = env.action_space.low, env.action_space.high, wrap the "
            f"environment in {made}",
        )
    with np.errstate(over="ignore"):
        width = space.high - space.low
    if not np.isfinite(width).all():
        made = wrapped.format("lambda action: action", "a smaller one")
        return (
            "have a finite range",
            f"high − low overflows; choose others, and wrap the environment in {made}",
        )
    return None
