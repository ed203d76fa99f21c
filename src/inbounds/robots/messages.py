"""MuJoCo's messages, as Python warnings.

Left alone, MuJoCo prints a warning to standard error and appends it to a file MUJOCO_LOG.TXT in the working
directory. Here one handler takes both places: it drops the single message that is known and harmless, and passes
every other on to `warnings`. It is installed when `inbounds.robots` first imports MuJoCo.
"""

import warnings

import mujoco

# Half of Gymnasium's robots use this attribute of MuJoCo's model files; it is not ours to change.
_KNOWN = "compiler attribute 'settotalmass' is deprecated"

_pending: list[Warning] = []


class MujocoWarning(RuntimeWarning):
    """A warning of the physics engine, such as an unstable simulation."""


def install_handler() -> None:
    """Send MuJoCo's warnings through Python's; repeated calls do no harm."""
    mujoco.set_mju_user_warning(_handle)


def raise_pending() -> None:
    """Raise a warning that a filter had turned into an error while C code was running.

    Raises:
        MujocoWarning: at least one such warning waits; it is raised once.
    """
    if _pending:
        first = _pending[0]
        _pending.clear()
        raise first


def _handle(message: str) -> None:
    if _KNOWN in message:
        return
    try:
        warnings.warn(message.strip(), MujocoWarning, stacklevel=2)
    except Warning as error:  # it must not leave this function: C++ cannot catch it and would end the process
        _pending.append(error)
