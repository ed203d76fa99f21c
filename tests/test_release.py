"""Version, address and change log say one thing wherever they stand, and a release is refused while they do not."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import inbounds
from inbounds.book.pages import citing
from tools import release_notes

ROOT = Path(__file__).resolve().parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf8"))
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf8"))
REPOSITORY = yaml.safe_load((ROOT / "_config.yml").read_text(encoding="utf8"))["repository"]
NOTES = (
    "# Changelog\n\n## [Unreleased]\n\nMore.\n\n## [1.2.0] - 2026-12-01\n\nA room.\n\n## [1.1.0]\n\nA door.\n"
)


def test_the_version_stands_in_one_place() -> None:
    project = PYPROJECT["project"]
    assert "version" in project["dynamic"]
    assert "version" not in project
    where = ROOT / PYPROJECT["tool"]["hatch"]["version"]["path"]
    assert where == ROOT / "src" / "inbounds" / "__init__.py"
    assert f'__version__ = "{inbounds.__version__}"' in where.read_text(encoding="utf8")
    assert CITATION["version"] == inbounds.__version__


def test_the_change_log_knows_the_version() -> None:
    assert release_notes.section((ROOT / "CHANGELOG.md").read_text(encoding="utf8"), inbounds.__version__)


def test_the_address_of_the_repository_is_the_configurations() -> None:
    url = REPOSITORY["url"]
    assert re.fullmatch(r"https://[\w.-]+/[\w.-]+/[\w.-]+", url)
    urls = PYPROJECT["project"]["urls"]
    assert urls == {
        "Repository": url,
        "Changelog": f"{url}/blob/{REPOSITORY['branch']}/CHANGELOG.md",
        "Issues": f"{url}/issues",
    }
    assert CITATION.get("repository-code", url) == url


def test_the_packages_readme_links_to_the_repositorys_files() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf8")
    relative = re.findall(r"\]\((?!https:)([^)]+)\)", readme)
    assert relative
    assert [path for path in relative if not (ROOT / path).is_file()] == []
    for rule in PYPROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        readme = re.sub(rule["pattern"], rule["replacement"], readme)
    assert re.findall(r"\]\((?!https:)([^)]+)\)", readme) == []
    ours = f"{REPOSITORY['url']}/(blob|raw)/{REPOSITORY['branch']}/"
    linked = re.findall(rf"\]\({ours}([^)]+)\)", readme)
    assert [path for _, path in linked] == relative
    assert {path for kind, path in linked if kind == "raw"} == {
        path for path in relative if path.endswith(".svg")
    }


def test_the_page_that_tells_to_clone_has_the_configurations_address() -> None:
    url, remark = REPOSITORY["url"], citing.cloning(REPOSITORY["url"])[-1]
    preface = (ROOT / "book" / "preface.md").read_text(encoding="utf8")
    assert "```{how-to-clone}" in preface
    assert f"git clone {url}" in citing.cloning(url)
    assert citing.PLACEHOLDER == release_notes.PLACEHOLDER
    assert ("is a placeholder" in remark) == (citing.PLACEHOLDER in url)
    told = [*ROOT.glob("*.md"), *ROOT.glob("book/*.md"), *ROOT.glob("notebooks/*.ipynb")]
    assert [path.name for path in told if "git clone" in path.read_text(encoding="utf8")] == []


def test_no_other_file_has_the_placeholder_in_an_address() -> None:
    placed = f"//github.com/{release_notes.PLACEHOLDER}/"
    files = [
        *ROOT.glob("*"),
        *ROOT.glob(".github/**/*"),
        *ROOT.glob("book/*"),
        *ROOT.glob("notebooks/*.ipynb"),
    ]
    found = {
        path.name for path in files if path.is_file() and placed in path.read_bytes().decode("utf8", "ignore")
    }
    assert found <= {"_config.yml", "pyproject.toml"}


def test_the_notes_are_the_versions_own() -> None:
    assert release_notes.section(NOTES, "1.2.0") == "A room."
    assert release_notes.section(NOTES, "1.1.0") == "A door."
    with pytest.raises(ValueError, match=r"no section \[1.3.0\]"):
        release_notes.section(NOTES, "1.3.0")


def test_a_release_is_refused_while_something_is_missing() -> None:
    ready = {
        "tag": "v1.2.0",
        "version": "1.2.0",
        "url": "https://github.com/someone/in-bounds",
        "notes": NOTES,
    }
    assert release_notes.missing(**ready) == []
    assert release_notes.missing(**ready | {"tag": "v1.1.0"}) == ["the tag is v1.1.0, the version 1.2.0"]
    (address,) = release_notes.missing(**ready | {"url": f"https://github.com/{release_notes.PLACEHOLDER}/x"})
    assert "_config.yml" in address
    (log,) = release_notes.missing(**ready | {"notes": NOTES.replace(" - 2026-12-01", " - unreleased")})
    assert "date" in log
    (log,) = release_notes.missing(**ready | {"notes": "# Changelog\n"})
    assert "no section [1.2.0]" in log
