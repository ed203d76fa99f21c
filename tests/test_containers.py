"""A machine is set up with what the project pins. Of Binder and the dev container only the texts are read."""

import json
import os
import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import Version

from inbounds.cli.classroom import ready
from inbounds.cli.classroom.doctor import SUPPORTED

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf8"))["project"]
BINDER = [
    line
    for line in (ROOT / ".binder" / "requirements.txt").read_text(encoding="utf8").splitlines()
    if line and not line.startswith("#")
]
CONTAINER = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text(encoding="utf8"))
PINS = {
    canonicalize_name(name): Version(version)
    for name, version in re.findall(r"^([\w.-]+)==(\S+)", (ROOT / "constraints.txt").read_text(), re.M)
}


def pythons() -> dict[str, str]:
    """The minor version of Python of each container, by its file."""
    binder = (ROOT / ".binder" / "runtime.txt").read_text(encoding="utf8").strip()
    return {
        "binder": binder.removeprefix("python-"),
        "dev": re.search(r"python:(3\.\d+)", CONTAINER["image"])[1],
    }


@pytest.mark.parametrize("where", ["binder", "dev"])
def test_its_python_is_one_that_the_project_runs_on(where: str) -> None:
    version = pythons()[where]
    assert Version(version) in SpecifierSet(PROJECT["requires-python"])
    assert SUPPORTED[0] <= tuple(map(int, version.split("."))) <= SUPPORTED[1]


def test_binder_installs_the_package_with_the_pins() -> None:
    constraints, package = BINDER
    assert constraints.startswith("-c ")
    assert (ROOT / ".binder" / constraints[3:]).resolve() == ROOT / "constraints.txt"
    extras = re.fullmatch(r"-e \.\[([\w,]+)\]", package)
    assert extras
    assert set(extras[1].split(",")) <= PROJECT["optional-dependencies"].keys()
    assert package in ready.INSTALL.replace('"', "")  # what a student is told installs the same


def test_binder_has_the_system_packages() -> None:
    assert (ROOT / ".binder" / "apt.txt").read_text() == (ROOT / "apt.txt").read_text()


def test_a_session_starts_with_the_students_copies() -> None:
    script = ROOT / ".binder" / "postBuild"
    assert os.access(script, os.X_OK)
    commands = [
        line for line in script.read_text().splitlines() if line and not line.startswith(("#", "set "))
    ]
    assert commands == ["python tools/student_copies.py lab"]
    assert (ROOT / "tools" / "student_copies.py").is_file()


def test_the_dev_container_is_set_up_as_every_machine_is() -> None:
    command = CONTAINER["postCreateCommand"].split()
    assert command == ["bash", "tools/setup.sh"]
    setup = (ROOT / command[1]).read_text(encoding="utf8")
    assert "-c constraints.txt" in setup
    assert "apt.txt" in setup
    interpreter = CONTAINER["customizations"]["vscode"]["settings"]["python.defaultInterpreterPath"]
    assert interpreter.endswith("/.venv/bin/python")  # which setup.sh makes


def test_every_requirement_has_a_pin_that_fits_it() -> None:
    extras = PROJECT["optional-dependencies"]
    wanted = [Requirement(text) for text in (*PROJECT["dependencies"], *extras["book"], *extras["lab"])]
    assert len(wanted) > 20
    for each in wanted:
        if each.name != "inbounds":
            assert PINS[canonicalize_name(each.name)] in each.specifier, each


def test_every_pin_installs_on_the_oldest_python() -> None:
    oldest = re.fullmatch(r">=(3\.\d+)", PROJECT["requires-python"])[1] + ".0"
    asks = {name: metadata.metadata(name).get("Requires-Python") for name in PINS if installed(name)}
    assert len(asks) > 100
    assert [name for name, text in asks.items() if text and oldest not in SpecifierSet(text)] == []


def installed(name: str) -> bool:
    """Whether the pinned version is what this environment has."""
    try:
        return Version(metadata.version(name)) == PINS[canonicalize_name(name)]
    except metadata.PackageNotFoundError:
        return False
