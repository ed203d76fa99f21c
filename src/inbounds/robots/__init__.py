"""Where actions are executed: MuJoCo's robots, stepped in one batch and drawn without a display.

Names are imported on first use, because ``import inbounds`` passes through this package to choose the off-screen
backend (:mod:`inbounds.robots.headless`), and that has to happen before ``mujoco`` is imported.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from inbounds.robots.headless import naming_the_backend

if TYPE_CHECKING:
    from inbounds.robots.messages import MujocoWarning
    from inbounds.robots.registration import make
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
    "make": "registration",
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


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with naming_the_backend():  # also because Python would take an AttributeError for a missing name
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value  # found directly from now on
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
