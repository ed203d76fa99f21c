"""What a vector environment owes to a learner, as named checks: each looks at one thing and says what is wrong.

They see an environment from outside, through `reset` and `step`, and take what makes one for a number of seeds:

    >>> import gymnasium
    >>> from gymnasium.vector import AutoresetMode, SyncVectorEnv
    >>> def pendulums(num_envs):
    ...     make = [lambda: gymnasium.make("Pendulum-v1")] * num_envs
    ...     return SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)
    >>> complaints(pendulums)
    {}

Gymnasium's own `check_env` looks at a single environment and its spaces; nothing there can see a neighbour, a reset in
the middle of a batch, or a clock. These do not replace it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from inbounds.learning.rollout import check_environments

__all__ = ["CHECKS", "MakeEnvs", "complaints"]

MakeEnvs: TypeAlias = Callable[[int], VectorEnv[Any, Any, Any]]
"""Makes a vector environment for a number of seeds."""
Check: TypeAlias = Callable[[MakeEnvs], "str | None"]
"""Returns what is wrong, or None."""

SHORT, LONG = 30, 1100
"""Env steps of a quick look, and of one that shall see episodes end: some clocks run for 1000."""


class Course(NamedTuple):
    """What T steps of N environments gave, copied as it came."""

    obs: NDArray[Any]
    """`[T + 1, N, O]`, the first from the reset."""
    reward: NDArray[Any]
    """`[T, N]`."""
    terminated: NDArray[Any]
    """`[T, N]`."""
    truncated: NDArray[Any]
    """`[T, N]`."""
    infos: list[dict[str, Any]]
    """T of them."""


def run(envs: VectorEnv[Any, Any, Any], seeds: list[int], actions: NDArray[Any]) -> Course:
    """Reset to the seeds `[N]` and take the actions `[T, N, A]`."""
    obs = [np.array(envs.reset(seed=seeds)[0])]  # type: ignore[arg-type]  # every vector environment takes a list
    outcomes: list[tuple[Any, ...]] = []
    infos = []
    for action in actions:
        following, *outcome, info = envs.step(action)
        obs.append(np.array(following))
        outcomes.append(tuple(np.array(x) for x in outcome))
        infos.append(info)
    reward, terminated, truncated = (np.stack(x) for x in zip(*outcomes, strict=True))
    return Course(np.stack(obs), reward, terminated, truncated, infos)


def random_actions(envs: VectorEnv[Any, Any, Any], steps: int, seed: int = 0) -> NDArray[Any]:
    """Return actions `[T, N, A]`, uniform in the box."""
    box: Any = envs.single_action_space
    unit = np.random.default_rng(seed).uniform(size=(steps, envs.num_envs, *box.shape))
    return (box.low + (box.high - box.low) * unit).astype(box.dtype)


def _spaces(make: MakeEnvs) -> str | None:
    envs = make(3)
    try:
        check_environments(envs, 3)
    except ValueError as error:
        return str(error)
    space: Any = envs.single_observation_space
    obs, reward = envs.reset(seed=[0, 1, 2])[0], np.zeros(3)  # type: ignore[arg-type]
    for action in random_actions(envs, SHORT):
        if len(obs) != 3 or not all(space.contains(each) for each in obs):
            return f"observations are not one of {space} for each environment, but {obs}, of type {obs.dtype}"
        if np.shape(reward) != (3,):
            return f"rewards must come as an array of shape [N], got {list(np.shape(reward))} for N = 3"
        if not (np.isfinite(obs).all() and np.isfinite(reward).all()):
            return "an observation or a reward is not finite"
        obs, reward, *_ = envs.step(action)
    return None


def _seeds(make: MakeEnvs) -> str | None:
    envs = make(2)
    actions = random_actions(envs, SHORT)
    first, again, other = (run(envs, seeds, actions) for seeds in ([3, 4], [3, 4], [5, 6]))
    if not _same(first, again):
        return "two resets to the same seeds, and the same actions, do not give the same episodes"
    if np.array_equal(first.obs, other.obs) and np.array_equal(first.reward, other.reward):
        return None  # an environment without chance
    if not _same(first, run(make(2), [3, 4], actions)):
        return "a new environment and a used one give different episodes from the same seeds"
    return None


def _neighbours(make: MakeEnvs) -> str | None:
    envs, fewer = make(3), make(2)
    actions = random_actions(envs, SHORT)
    changed = actions.copy()
    changed[:, 1:] = random_actions(envs, SHORT, seed=1)[:, 1:]
    mine = run(envs, [7, 8, 9], actions)
    for which, course in {
        "its neighbours act otherwise": run(envs, [7, 8, 9], changed),
        "its neighbours have other seeds": run(envs, [7, 5, 6], actions),
        "it has fewer neighbours": run(fewer, [7, 8], actions[:, :2]),
    }.items():
        if not np.array_equal(mine.obs[:, 0], course.obs[:, 0]) or not np.array_equal(
            mine.reward[:, 0], course.reward[:, 0]
        ):
            return f"the first environment's episode changes when {which}"
    return None


def _own_copies(make: MakeEnvs) -> str | None:
    envs = make(2)
    actions = random_actions(envs, SHORT)
    given = [envs.reset(seed=[0, 1])[0]]  # type: ignore[arg-type]
    as_it_came = [given[0].copy()]
    for action in actions:
        given.append(envs.step(action)[0])
        as_it_came.append(given[-1].copy())
    if not np.array_equal(given, as_it_came):
        return "an observation that was handed out is changed by a later step: hand out a copy"
    return None


def _bounds(make: MakeEnvs) -> str | None:
    envs = make(1)
    box: Any = envs.single_action_space
    middle = ((box.low + box.high) / 2).astype(box.dtype)
    for i in range(len(middle)):
        outcomes = []
        for value in (box.low[i], middle[i], box.high[i]):
            action = middle.copy()
            action[i] = value
            course = run(envs, [0], np.broadcast_to(action, (SHORT, 1, len(middle))))
            outcomes.append(np.concatenate([course.obs[1:].ravel(), course.reward.ravel()]))
        for a, b, where in ((0, 1, "lower"), (1, 2, "upper")):
            if np.array_equal(outcomes[a], outcomes[b]):
                return (
                    f"action {i} does the same anywhere in the {where} half of its interval "
                    f"[{box.low[i]:g}, {box.high[i]:g}]: is it read in other units than the box's?"
                )
    return None


def _final_observation(make: MakeEnvs) -> str | None:
    course = _to_the_end(make)
    alike = []  # once may be chance, where there are few observations
    for t, n in np.argwhere(course.terminated | course.truncated):
        final = course.infos[t].get("final_obs")
        if final is None or final[n] is None:
            return "an episode ends without info['final_obs']: its last observation is lost to the bootstrap"
        alike.append(np.array_equal(np.ravel(final[n]), course.obs[t + 1, n].ravel()))
    if alike and all(alike):
        return "info['final_obs'] is the first observation of the next episode, not the last of this one"
    return None


def _time_limit(make: MakeEnvs) -> str | None:
    course = _to_the_end(make)
    if (course.truncated & ~course.terminated).any():  # with both flags an episode counts as terminated
        return None
    lengths: dict[int, set[int]] = {}  # of episodes; in which environments, each of which acts in its own way
    for n in range(course.reward.shape[1]):
        ends = np.flatnonzero(course.terminated[:, n])
        for length in np.diff(ends, prepend=-1):
            lengths.setdefault(int(length), set()).add(n)
    longest = max(lengths, default=0)
    if longest > 1 and len(lengths.get(longest, ())) >= 3:  # no accident
        return (
            f"no episode is longer than {longest} steps, and those that reach it are called terminated: that is a "
            "clock, hence truncated"
        )
    return None


def _to_the_end(make: MakeEnvs) -> Course:
    """Run many environments, each with a constant action of its own: some of them shall last."""
    envs = make(32)
    actions = np.repeat(random_actions(envs, 1), LONG, 0)
    return run(envs, list(range(32)), actions)


def _same(a: Course, b: Course) -> bool:
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a[:4], b[:4], strict=True))


CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "spaces": _spaces,
        "seeds": _seeds,
        "neighbours": _neighbours,
        "own copies": _own_copies,
        "bounds": _bounds,
        "final observation": _final_observation,
        "time limit": _time_limit,
    }
)
"""By name, in the order in which they are run."""


def complaints(make: MakeEnvs) -> dict[str, str]:
    """Run all checks; where the spaces are wrong, nothing else can be judged.

    Args:
        make: makes a vector environment for a number of seeds.

    Returns:
        By check, what is wrong; empty if nothing is.

    Example:
        >>> from inbounds import robots
        >>> complaints(lambda seeds: robots.make("Swimmer-v5", seeds))
        {}
    """
    found: dict[str, str] = {}
    for name, check in CHECKS.items():
        if "spaces" not in found and (complaint := check(make)):
            found[name] = complaint
    return found
