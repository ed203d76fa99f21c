"""`tools/setup.sh`: which Python it takes, when it starts anew, when it asks pip, and that one at a time does.

Python, pip and the disk are made up, so that nothing is installed.
"""

import shutil
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

SETUP = Path(__file__).resolve().parents[1] / "tools" / "setup.sh"
COMMANDS = (
    "awk",
    "bash",
    "cat",
    "cksum",
    "dirname",
    "grep",
    "head",
    "mkdir",
    "rm",
    "sleep",
    "tail",
    "uname",
    "xargs",
)
MADE_UP = """#!/bin/bash
# A Python {version}: it notes what it is asked for, and answers with another one.
case "$*" in
  *"sys.version_info[:2]"*) echo {version} ;;
  *ensurepip*) exit {bare} ;;
  *"import pip"*) ;;
  -V) echo "Python {version}" ;;
  "-m venv"*) echo "venv by {version}" >> "$LOG"
    [ -z "${{BROKEN:-}}" ] || {{ echo "it is broken" >&2; exit 1; }}
    rm -rf .venv; mkdir -p .venv/bin
    cat "$0" > .venv/bin/python; chmod +x .venv/bin/python
    case "$PWD" in  # as pip does it
      *" "*) printf '%s\\n' '#!/bin/sh' "'''exec' \\"$PWD/.venv/bin/python\\" \\"\\$0\\"" > .venv/bin/pip ;;
      *) echo "#!$PWD/.venv/bin/python" > .venv/bin/pip ;;
    esac ;;
  "-m pip install"*) echo "install" >> "$LOG"; sleep "${{PIP_SECONDS:-0}}" ;;
  "-m pip check"*) ;;
  *) exec {python} "$@" ;;
esac
"""


class Clone:
    """A clone with made-up commands, and what was asked of them."""

    def __init__(self, tmp_path: Path, folder: str) -> None:
        self.commands, self.log, self.path = tmp_path / "bin", tmp_path / "log", tmp_path / folder
        self.commands.mkdir()
        (self.path / "tools").mkdir(parents=True)
        shutil.copy(SETUP, self.path / "tools")
        for name in ("pyproject.toml", "constraints.txt", "apt.txt"):
            shutil.copy(SETUP.parents[1] / name, self.path)
        for name in (*COMMANDS, "chmod"):
            (self.commands / name).symlink_to(shutil.which(name))
        self.command("dpkg-query", "#!/bin/bash\necho ok installed\n")
        self.disk(9_000_000)

    def command(self, name: str, text: str) -> Path:
        path = self.commands / name
        path.write_text(text, encoding="utf8")
        path.chmod(0o755)
        return path

    def python(self, name: str, version: str, bare: int = 0) -> Path:
        return self.command(name, MADE_UP.format(version=version, bare=bare, python=sys.executable))

    def disk(self, free: int) -> None:
        self.command("df", f"#!/bin/bash\nprintf 'head\\n/dev/a 1 1 {free} 1%% /\\n'\n")

    def start(self, folder: Path | None = None, **variables: str) -> subprocess.Popen:
        return subprocess.Popen(
            [shutil.which("bash"), "tools/setup.sh"],
            cwd=folder or self.path,
            env={
                "PATH": str(self.commands),
                "LOG": str(self.log),
                "PWD": str(folder or self.path),
                **variables,
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, folder: Path | None = None, **variables: str) -> tuple[int, str, list[str]]:
        """Set up; return the exit status, what was said, and what Python was asked for."""
        self.log.unlink(missing_ok=True)
        ran = self.start(folder, **variables)
        said = "".join(ran.communicate())
        return ran.returncode, said, self.log.read_text().splitlines() if self.log.exists() else []


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    return Clone(tmp_path, "clone")


def test_an_environment_behind_a_link_is_left_as_it_is(tmp_path: Path, clone: Clone) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "kept").write_text("packages", encoding="utf-8")
    (clone.path / ".venv").symlink_to(tmp_path / "other")
    status, said, _ = clone.run()
    assert status == 1
    assert ".venv is a link" in said
    assert "rm .venv" in said
    assert (tmp_path / "other" / "kept").read_text(encoding="utf-8") == "packages"


def test_the_newest_python_that_is_supported_and_whole_is_taken(clone: Clone) -> None:
    clone.python("python3", "3.14")
    clone.python("python3.13", "3.13", bare=1)
    clone.python("python3.12", "3.12")
    clone.python("python3.11", "3.11")
    assert clone.run()[2] == ["venv by 3.12", "install"]


@pytest.mark.parametrize(
    ("name", "version", "bare", "named", "said"),
    [
        ("python3", "3.14", 0, "", "python3 is 3.14"),
        ("python3", "3.13", 1, "", "apt install python3.13-venv"),
        ("python2", "2.7", 0, "", "no Python 3.11, 3.12 or 3.13 found"),
        ("python3.12", "3.12", 0, "python3.99", "no Python that runs by the name of python3.99"),
        ("a python", "3.10", 0, "a python", "a python is 3.10"),
    ],
)
def test_without_a_python_it_stops_and_says_what_is_missing(
    name: str, version: str, bare: int, named: str, said: str, clone: Clone
) -> None:
    clone.python(name, version, bare)
    status, told, asked = clone.run(PYTHON=named)
    assert (status, asked) == (1, [])
    assert said in told


def test_a_named_python_may_have_a_space_in_its_path(clone: Clone) -> None:
    clone.python("python3.13", "3.13")
    named = clone.python("a python", "3.11")
    assert clone.run(PYTHON=str(named))[2] == ["venv by 3.11", "install"]


def test_why_an_environment_cannot_be_created_is_said(clone: Clone) -> None:
    clone.python("python3.12", "3.12")
    status, said, _ = clone.run(BROKEN="yes")
    assert status == 1
    assert "it is broken" in said


@pytest.mark.parametrize("folder", ["clone", "a clone"])
def test_an_environment_stays_where_it_was_made(folder: str, tmp_path: Path) -> None:
    """With a space in the path, too, and by way of a link; not after the folder was moved."""
    clone = Clone(tmp_path, folder)
    clone.python("python3.12", "3.12")
    (tmp_path / "link").symlink_to(clone.path)
    assert clone.run()[2] == ["venv by 3.12", "install"]
    assert clone.run()[2] == clone.run(tmp_path / "link")[2] == []
    (clone.path / "constraints.txt").write_text("", encoding="utf8")
    clone.disk(1_000_000)  # what is there already needs no room
    assert clone.run(tmp_path / "link")[2] == ["install"]
    assert clone.run()[2] == []
    moved = clone.path.rename(tmp_path / "moved")
    assert "about 4 GB" in clone.run(moved)[1]
    clone.disk(9_000_000)
    assert clone.run(moved)[2] == ["venv by 3.12", "install"]


def test_only_what_pip_reads_of_the_project_asks_pip(clone: Clone) -> None:
    clone.python("python3.12", "3.12")
    clone.run()
    project = clone.path / "pyproject.toml"
    text = project.read_text(encoding="utf8")
    project.write_text(text.replace("[tool.ruff]", "[tool.ruff]\npreview = false"), encoding="utf8")
    assert clone.run()[2] == []
    project.write_text(text.replace("[project]", "[project]\nmaintainers = []"), encoding="utf8")
    assert clone.run()[2] == ["install"]


def test_two_set_up_one_after_the_other(clone: Clone) -> None:
    """The second waits and finds all done; one that was killed holds nobody up."""
    clone.python("python3.12", "3.12")
    killed = clone.start(PIP_SECONDS="600")
    killed.stdout.readline()
    while not clone.log.exists() or "install" not in clone.log.read_text():
        assert killed.poll() is None
        time.sleep(0.05)
    second = clone.start()
    assert "waiting for it" in second.stdout.readline()
    for process in psutil.Process(killed.pid).children(recursive=True):
        process.kill()
    killed.kill()
    killed.communicate()
    assert "is ready" in second.communicate()[0]
    assert clone.run()[2] == []
