"""Where actions are executed: MuJoCo's robots, stepped in one batch and drawn without a display.

Names are imported on first use, because ``import inbounds`` passes through this package to choose the off-screen
backend (:mod:`inbounds.robots.headless`), and that has to happen before ``mujoco`` is imported.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inbounds.robots.messages import MujocoWarning
    from inbounds.robots.registration import make
    from inbounds.robots.rendering import Camera, Film, RobotRenderer, record
    from inbounds.robots.vector_env import TASKS, RobotVectorEnv

_HOME = {
    "TASKS": "vector_env",
    "Camera": "rendering",
    "Film": "rendering",
    "MujocoWarning": "messages",
    "RobotRenderer": "rendering",
    "RobotVectorEnv": "vector_env",
    "make": "registration",
    "record": "rendering",
}

__all__ = ["TASKS", "Camera", "Film", "MujocoWarning", "RobotRenderer", "RobotVectorEnv", "make", "record"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    except (
        AttributeError
    ) as error:  # what PyOpenGL raises in `import mujoco`; Python would report a missing name
        raise ImportError(
            f"MuJoCo cannot be imported with MUJOCO_GL={os.environ.get('MUJOCO_GL')} ({error}): unset it and start "
            "Python again, or install the library that it names"
        ) from error
    globals()[name] = value  # found directly from now on
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
