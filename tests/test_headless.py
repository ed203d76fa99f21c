"""The choice of OpenGL, in fresh interpreters: it is made once per process, before MuJoCo is imported."""

import os
import subprocess
import sys
import textwrap

import pytest

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux needs a headless backend"
)


def run(code: str, tmp_path, **env: str | None) -> str:
    """Run a program in a new Python without a display; return what it printed, stderr included."""
    environ = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL")}
    environ |= {k: v for k, v in env.items() if v is not None}
    environ.pop("PYOPENGL_PLATFORM", None)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        env=environ,
        cwd=tmp_path,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.iterdir()), "nothing may be written, MUJOCO_LOG.TXT least of all"
    return done.stdout + done.stderr


def hiding(*libraries: str, pretending: str = "") -> str:
    """Code after which ctypes cannot load these libraries, and believes that it has loaded the pretended one."""
    return textwrap.dedent(f"""
        import ctypes, ctypes.util
        original, find = ctypes.CDLL, ctypes.util.find_library
        def cdll(name, *args, **kwargs):
            if name == {pretending!r}:
                return None
            if any(library in str(name) for library in {libraries!r}):
                raise OSError(name)
            return original(name, *args, **kwargs)
        ctypes.CDLL = cdll
        ctypes.util.find_library = lambda name: None if name in str({libraries!r}) else find(name)
        """)


SHOW = "import os, inbounds; print(os.environ.get('MUJOCO_GL'))"


def test_importing_the_package_chooses_egl(tmp_path):
    assert run(SHOW, tmp_path).strip() == "egl"


def test_a_choice_of_the_user_is_kept(tmp_path):
    assert run(SHOW, tmp_path, MUJOCO_GL="osmesa").strip() == "osmesa"


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_display_needs_no_choice(variable, tmp_path):
    assert run(SHOW, tmp_path, **{variable: ":0"}).strip() == "None"


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_need_no_choice(platform, tmp_path):
    code = "import sys; from inbounds import headless; import os; os.environ.pop('MUJOCO_GL', None);"
    code += f"sys.platform = {platform!r}; print(headless.choose_backend())"
    assert run(code, tmp_path).strip() == "None"


def test_osmesa_stands_in_for_egl(tmp_path):
    code = hiding("libEGL.so.1", pretending="libOSMesa.so.8") + SHOW
    assert run(code, tmp_path).strip() == "osmesa"


TRY_TO_DRAW = """
import gymnasium
from inbounds.robots import RobotRenderer
env = gymnasium.make("Hopper-v5")
env.reset(seed=0)
try:
    print(RobotRenderer(env).frame().shape)
except RuntimeError as error:
    print("RuntimeError:", error)
print("alive")
"""


def test_drawing_works_after_the_package(tmp_path):
    assert run("import inbounds" + TRY_TO_DRAW, tmp_path).splitlines() == ["(240, 320, 3)", "alive"]


def test_a_backend_without_its_library_is_named(tmp_path):
    code = """
        import inbounds
        try:
            from inbounds.robots import RobotRenderer
        except ImportError as error:
            print(error)
        """
    output = run(hiding("libOSMesa") + textwrap.dedent(code), tmp_path, MUJOCO_GL="osmesa")
    assert "MUJOCO_GL=osmesa" in output
    assert "unset it" in output


def test_mujoco_imported_too_early_is_an_error_not_a_crash(tmp_path):
    first, last = run("import mujoco, inbounds" + TRY_TO_DRAW, tmp_path).splitlines()
    assert "import inbounds before mujoco" in first
    assert last == "alive"


def test_a_variable_set_too_late_is_an_error_not_a_crash(tmp_path):
    code = "import mujoco, os; os.environ['MUJOCO_GL'] = 'egl'; import inbounds" + TRY_TO_DRAW
    first, last = run(code, tmp_path).splitlines()
    assert "Restart Python" in first
    assert last == "alive"


# EGL alone is what Debian's libegl1 brings: calls of OpenGL itself stand in another library.
@pytest.mark.parametrize("missing", [("libEGL.so.1",), ("libOpenGL.so", "libGL.so")])
def test_missing_libraries_are_named(missing, tmp_path):
    code = hiding(*missing, "libOSMesa.so.8") + "import inbounds" + TRY_TO_DRAW
    assert "apt install libegl1 libgl1-mesa-dri libopengl0" in run(code, tmp_path)


def test_missing_driver_is_named(tmp_path):
    # libEGL is there, but none of its drivers: what libegl1 without libgl1-mesa-dri looks like
    output = run("import inbounds" + TRY_TO_DRAW, tmp_path, __EGL_VENDOR_LIBRARY_DIRS=str(tmp_path))
    assert "apt install libegl1 libgl1-mesa-dri libopengl0" in output
    assert output.splitlines()[-1] == "alive"


def test_switched_off_says_so(tmp_path):
    assert "MUJOCO_GL=disable switches rendering off" in run(
        "import inbounds" + TRY_TO_DRAW, tmp_path, MUJOCO_GL="disable"
    )
