"""Where actions are executed: MuJoCo's robots, stepped in one batch and drawn without a display.

Names are imported on first use: what steps no robots, such as a policy that is loaded to act, need not load MuJoCo.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from inbounds.headless import naming_the_backend
from inbounds.robots.registration import NAMESPACE, register

if TYPE_CHECKING:
    from inbounds.robots.messages import MujocoWarning
    from inbounds.robots.rendering import Camera, Film, RobotRenderer, is_drawable, record
    from inbounds.robots.vector_env import TASKS, RobotVectorEnv

_HOME = {
    "TASKS": "vector_env",
    "Camera": "rendering",
    "Film": "rendering",
    "MujocoWarning": "messages",
    "RobotRenderer": "rendering",
    "RobotVectorEnv": "vector_env",
    "is_drawable": "rendering",
    "record": "rendering",
}

__all__ = [
    "TASKS",
    "Camera",
    "Film",
    "MujocoWarning",
    "RobotRenderer",
    "RobotVectorEnv",
    "is_drawable",
    "make",
    "record",
]

register()


def make(name: str, num_envs: int = 1, **kwargs: Any) -> "RobotVectorEnv":
    """Return robots with one of the six tasks, in one vector environment.

    Args:
        name: of the task, such as `"HalfCheetah-v5"`.
        num_envs: number of robots.
        **kwargs: as for `inbounds.robots.RobotVectorEnv`.

    Returns:
        The environment.

    Raises:
        ValueError: the class does not take an argument's value.
        TypeError: it has no such argument.

    Example:
        >>> envs = make("Hopper-v5", num_envs=10)
        >>> envs.reset(seed=0)[0].shape
        (10, 11)
    """
    with naming_the_backend():
        from inbounds.robots.vector_env import RobotVectorEnv

    return RobotVectorEnv(name.removeprefix(f"{NAMESPACE}/"), num_envs, **kwargs)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with naming_the_backend():  # also because Python would take an AttributeError for a missing name
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value  # found directly from now on
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
