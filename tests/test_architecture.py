"""The rules of the house: imports go one way, the package is light, files stay readable."""

import ast
import fnmatch
import importlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "inbounds"
MAY_IMPORT = {
    "distributions": set(),
    "robots": set(),
    "learning": {"distributions", "robots"},
    "integrations": {"distributions"},
    "study": {"distributions", "robots", "learning"},
    "book": {"distributions", "robots", "learning", "study"},
    "cli": {"distributions", "robots", "learning", "study", "book"},
}
ENGINE = ("distributions", "robots", "learning")
LIGHT = ("", ".distributions", ".robots", ".learning", ".book.drawing.videos", ".cli.watching")
HEAVY = (
    *("IPython", "jupyter", "jupyter_book", "jupyter_core", "ipykernel"),
    *("bokeh", "mediapy", "matplotlib", "numba"),
)
COMPUTING = ("mujoco", "gymnasium", "torch")
"""What `inbounds` alone does without, too."""
MODULES = sorted(PACKAGE.rglob("*.py"))
BY_NAME = {
    ".".join(("inbounds", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in MODULES
}
API = (PACKAGE.parents[1] / "book" / "api.md").read_text(encoding="utf8")
DOCUMENTED = re.findall(r"\.\. auto(?:function|class):: (\S+)", API)


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def rooms_imported(path: Path) -> set[str]:
    """Names of the rooms that a module imports, wherever in the file it does so."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            if node.level:  # relative: resolve against the module's own package
                base = ["inbounds", *path.relative_to(PACKAGE).parent.parts]
                stem = base[: len(base) - node.level + 1]
                names = [".".join([*stem, *(node.module or alias.name for alias in node.names)])]
            elif node.module == "inbounds":
                names = [f"inbounds.{alias.name}" for alias in node.names]
            else:
                names = [node.module or ""]
        found |= {name.split(".")[1] for name in names if name.startswith("inbounds.")}
    return found & set(MAY_IMPORT)


@pytest.mark.parametrize("path", [p for p in MODULES if room_of(p) in MAY_IMPORT], ids=str)
def test_imports_go_one_way(path: Path) -> None:
    room = room_of(path)
    assert rooms_imported(path) <= MAY_IMPORT[room] | {room}


def modules_imported(path: Path) -> set[str]:
    """Modules of the package that a file imports, wherever in it: below TYPE_CHECKING and in functions, too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (names & BY_NAME.keys()) or {node.module}
    return found & BY_NAME.keys()


def test_no_file_imports_itself_by_way_of_others() -> None:
    graph = {name: modules_imported(path) - {name} for name, path in BY_NAME.items()}
    for name in graph:
        reached, new = set(), graph[name]
        while new:
            reached |= new
            new = set().union(*(graph[other] for other in new)) - reached
        assert name not in reached


@pytest.mark.parametrize("room", ENGINE)
def test_a_folder_of_the_engine_has_at_most_a_dozen_entries(room: str) -> None:
    folders = {path.parent for path in (PACKAGE / room).rglob("*.py")}
    for folder in folders:
        entries = [entry.name for entry in folder.iterdir() if not entry.name.startswith("__")]
        assert len(entries) <= 12, (folder.name, entries)


@pytest.fixture(scope="module")
def imported() -> dict[str, list[str]]:
    """What of `HEAVY` and `COMPUTING` a new process has after each import, one after another."""
    code = f"""
import importlib, json, sys
found = {{}}
for module in {LIGHT}:
    importlib.import_module("inbounds" + module)
    found[module] = [each for each in {HEAVY + COMPUTING} if each in sys.modules]
print(json.dumps(found))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return json.loads(done.stdout)


@pytest.mark.parametrize("module", LIGHT)
def test_importing_is_light(imported: dict[str, list[str]], module: str) -> None:
    assert set(imported[module]) <= (set(COMPUTING) if module else set())


@pytest.mark.parametrize("path", MODULES, ids=str)
def test_a_file_can_be_read_in_one_sitting(path: Path) -> None:
    assert len(path.read_text(encoding="utf8").splitlines()) <= 350


@pytest.mark.parametrize("name", DOCUMENTED)
def test_whatever_is_documented_has_an_example_or_says_who_has(name: str) -> None:
    module, _, thing = name.rpartition(".")
    doc = getattr(importlib.import_module(module), thing).__doc__
    assert ">>>" in doc or "has an example" in doc


def test_the_wheel_says_that_the_package_is_typed() -> None:
    """Hatch packs what lies in `packages` and git does not ignore."""
    marker = PACKAGE / "py.typed"
    assert marker.is_file()
    project = tomllib.loads((PACKAGE.parents[1] / "pyproject.toml").read_text(encoding="utf8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"] == {"packages": ["src/inbounds"]}
    ignored = (PACKAGE.parents[1] / ".gitignore").read_text(encoding="utf8").splitlines()
    assert not any(fnmatch.fnmatch(marker.name, line) for line in ignored)


@pytest.mark.parametrize(
    "path", sorted((PACKAGE.parents[1] / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem
)
def test_a_chapter_finds_the_study_wherever_it_is_run(path: Path) -> None:
    assert 'Path(\\"results\\")' not in path.read_text(encoding="utf8"), "use StudyFolder.shipped()"
