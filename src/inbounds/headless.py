"""Which OpenGL MuJoCo draws with, decided before MuJoCo is imported.

MuJoCo reads the environment variable `MUJOCO_GL` once, when it is first imported. On a Linux machine without a
display its own choice, GLFW, cannot draw; a later change of the variable does not help but ends the process
when the first frame is drawn. So `choose_backend` runs on `import inbounds`, and `require_backend`
refuses to draw while refusing is still possible. Neither imports `mujoco` or `gymnasium`, so that the
package stays light.
"""

import contextlib
import ctypes
import os
import sys
import traceback
from collections.abc import Iterator

PACKAGES_HINT = "sudo apt install libegl1 libgl1-mesa-dri libopengl0"

# In the order of preference: EGL draws on a GPU where there is one and in software elsewhere.
# Of each of a backend's groups one library is needed.
_LIBRARIES = {
    "egl": (("libEGL.so.1",), ("libOpenGL.so.0", "libGL.so.1")),
    "osmesa": (("libOSMesa.so.8",),),
}
_SWITCHED_OFF = ("disable", "disabled", "off", "false", "0")


class BackendError(ImportError):
    """MuJoCo cannot be imported with the OpenGL that `MUJOCO_GL` names; the message names the fix."""


@contextlib.contextmanager
def naming_the_backend() -> Iterator[None]:
    """Raise a `BackendError` in the place of whatever `import mujoco` raises over its OpenGL in this block.

    MuJoCo refuses an unknown name with a RuntimeError, and PyOpenGL, where a library is missing, trips over a None.
    """
    try:
        yield
    except BackendError:
        raise
    except (AttributeError, ImportError, RuntimeError) as error:
        frames = traceback.walk_tb(error.__traceback__)
        if not any(frame.f_globals.get("__name__") == "mujoco" for frame, _ in frames):
            raise  # about something else
        raise BackendError(
            f"MuJoCo cannot be imported with MUJOCO_GL={os.environ.get('MUJOCO_GL')} ({error}): unset it and start "
            "Python again, or install the library that it names"
        ) from error


def choose_backend() -> str | None:
    """Set `MUJOCO_GL` to a backend that can draw off screen, where MuJoCo would not find one itself.

    Nothing happens on macOS and Windows, with a display, when the variable is already set, or once `mujoco` is
    imported (see `require_backend`). On a headless Linux machine EGL is taken, or OSMesa where EGL's
    libraries cannot be loaded.

    Returns:
        The backend that was set, `"egl"` or `"osmesa"`; None where nothing was changed.
    """
    if os.environ.get("MUJOCO_GL") or "mujoco" in sys.modules or not _is_headless():
        return None
    for backend in _LIBRARIES:
        if _has_libraries(backend):
            os.environ["MUJOCO_GL"] = backend
            return backend
    return None  # importing MuJoCo still works, and require_backend says what to install


def require_backend() -> None:
    """Raise unless the backend that MuJoCo was imported with can draw here.

    Raises:
        RuntimeError: MuJoCo has no backend that can draw; the message names the fix.
    """
    from mujoco.rendering.classic import gl_context  # by now MuJoCo has made its choice

    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    chosen = getattr(getattr(gl_context, "GLContext", None), "__module__", "")  # such as "mujoco.egl"
    if not chosen and wanted in _SWITCHED_OFF:
        raise RuntimeError(f"MUJOCO_GL={wanted} switches rendering off: unset it and start Python again.")
    if chosen in ("mujoco.egl", "mujoco.osmesa") or (chosen and not _is_headless()):
        return
    if not any(_has_libraries(backend) for backend in _LIBRARIES):
        raise RuntimeError(f"No library can draw without a display. Install one: {PACKAGES_HINT}")
    raise RuntimeError(
        "MuJoCo was imported without a backend that can draw without a display. Restart Python (in a notebook: restart "
        "the kernel), unset MUJOCO_GL or set it to egl, and import inbounds before mujoco and gymnasium."
    )


def _is_headless() -> bool:
    """Return whether this is a Linux machine (or session) without a display."""
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.platform.startswith("linux") and not has_display


def _has_libraries(backend: str) -> bool:
    return all(any(_is_loadable(library) for library in group) for group in _LIBRARIES[backend])


def _is_loadable(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
