"""`inbounds doctor`: a machine that has all is told so, and whatever is taken away is named with its remedy."""

import shutil
import subprocess
import sys
from importlib import metadata
from types import SimpleNamespace

import pytest

from inbounds.cli.classroom import doctor
from tests.cli.small import run


@pytest.mark.slow
def test_this_machine_has_what_the_book_needs() -> None:
    code, out, err = run("doctor")
    assert (code, err) == (0, ""), out
    assert out.strip().splitlines()[-1] == "This machine has what the book needs."
    assert "✗" not in out
    for name in ("Python", "packages", "packages (book)", "disk", "drawing", "films", "training"):
        assert f"✓ {name}: " in out


def only(monkeypatch: pytest.MonkeyPatch, *looks) -> tuple[int, str]:
    monkeypatch.setattr(doctor, "LOOKS", looks)
    code, out, err = run("doctor")
    assert err == ""
    return code, " ".join(out.split())


def test_a_missing_package_and_an_old_one_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    real = metadata.version

    def version(name: str) -> str:
        if name == "pyarrow":
            raise metadata.PackageNotFoundError(name)
        return "0.1" if name == "scipy" else real(name)

    monkeypatch.setattr(metadata, "version", version)
    code, out = only(monkeypatch, doctor.look_at_packages)
    assert code == 1
    assert (
        "✗ packages: missing or of another version: pyarrow, scipy 0.1 (wanted >=1.15) pip install ." in out
    )
    assert "one thing is missing" in out.lower()


@pytest.mark.parametrize(
    ("name", "told"),
    [("pyarrow", "drawing: "), ("tyro", "drawing: "), ("rich", "the package rich is missing: pip install .")],
)
def test_it_speaks_without_what_is_missing(name: str, told: str) -> None:
    """In a process where the package cannot be imported; looking at packages alone is quick."""
    words = f"""
import sys
sys.modules[{name!r}] = None
from inbounds.cli import main
try:
    from inbounds.cli.classroom import doctor
    doctor.LOOKS = (lambda: doctor.Diagnosis("drawing", "fine", "here"),)
except ImportError:
    pass
sys.exit(main(["doctor"]))
"""
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert told in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["bogus", "disabled"])
def test_a_backend_that_cannot_draw_is_named(backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", backend)
    found = doctor.look_at_drawing()
    assert found.state == "missing"
    assert found.remedy.startswith("unset MUJOCO_GL"), found


def test_packages_that_cannot_be_looked_at_are_called_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def requires(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", requires)
    looks = [look for look in doctor.LOOKS if getattr(look, "func", look) is doctor.look_at_packages]
    code, out = only(monkeypatch, *looks)
    assert code == 1
    assert out.count("✗ packages: PackageNotFoundError") == len(looks) == 4


def test_what_only_some_need_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    wanted = [
        "numpy>=2",
        "numba>=0.68; extra == 'fast'",
        "inbounds[fast]; extra == 'book'",
        "x; extra == 'book'",
    ]
    monkeypatch.setattr(metadata, "requires", lambda _: wanted)
    monkeypatch.setattr(metadata, "version", version)
    code, out = only(monkeypatch, lambda: doctor.look_at_packages("fast"))
    assert code == 0
    assert '– packages (fast): missing or of another version: numba pip install ".[fast]"' in out


def test_an_extra_that_the_installation_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy>=2"])
    code, out = only(monkeypatch, lambda: doctor.look_at_packages("fast"))
    assert code == 0
    assert "– packages (fast): unknown to this installation" in out


@pytest.mark.parametrize(
    ("version", "mark"), [((3, 10), "✗"), ((3, 11), "✓"), ((3, 13), "✓"), ((3, 14), "–")]
)
def test_versions_of_python(version, mark, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "sys", SimpleNamespace(version_info=(*version, 0)))
    code, out = only(monkeypatch, doctor.look_at_python)
    assert f"{mark} Python: " in out
    assert code == (mark == "✗")


def test_a_full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1e9))
    code, out = only(monkeypatch, doctor.look_at_disk)
    assert code == 1
    assert "✗ disk: 1.0 GB free here free 3.0 GB, or work in another folder" in out


def test_opengl_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    said = SimpleNamespace(returncode=1, stderr="ImportError: no EGL here")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: said)
    code, out = only(monkeypatch, doctor.look_at_drawing)
    assert code == 1
    assert "✗ drawing: ImportError: no EGL here sudo apt install" in out


def test_opengl_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    def hang(*_, timeout: float, **__) -> None:
        raise subprocess.TimeoutExpired("python", timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    code, out = only(monkeypatch, doctor.look_at_drawing)
    assert code == 1
    assert "no frame within 120 s" in out


def test_a_missing_encoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mediapy", None)
    code, out = only(monkeypatch, doctor.look_at_films)
    assert code == 1
    assert "✗ films: no encoder videos need mediapy: pip install '.[video]'" in out


def test_without_the_book_an_encoder_is_optional(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mediapy", None)
    absent = doctor.Diagnosis("packages (book)", "optional", "not installed")
    monkeypatch.setattr(doctor, "look_at_packages", lambda extra: absent)
    code, out = only(monkeypatch, doctor.look_at_films)
    assert code == 0
    assert "– films: no encoder" in out


def test_one_thing_that_cannot_be_looked_at_does_not_hide_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def look_at_nothing() -> doctor.Diagnosis:
        raise OSError("no such thing")

    code, out = only(monkeypatch, look_at_nothing, doctor.look_at_disk)
    assert code == 1
    assert "✗ nothing: OSError: no such thing" in out
    assert "disk: " in out
