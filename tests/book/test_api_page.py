"""The page of the API, read by Sphinx alone: each name in a signature or a docstring is found, as in `make book`."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
CONF = """
import sys
sys.path.insert(0, {ext!r})
import inbounds_book as book

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
nitpicky = True
{settings}

def setup(app):
    app.connect("autodoc-process-docstring", book.shield, priority=400)
    app.connect("autodoc-process-docstring", book.restore, priority=600)
    app.connect("missing-reference", book.resolve_public_name)
"""


ALONE = "inbounds.cli.training.run"
"""No page has it, nor the types of its signature."""


@pytest.fixture(scope="module")
def complaints(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What Sphinx, set as the book sets it, cannot find on the page and on another, which shows `ALONE`."""
    folder = tmp_path_factory.mktemp("api")
    config = yaml.safe_load((ROOT / "_config.yml").read_text(encoding="utf8"))["sphinx"]["config"]
    chosen = {
        k: v
        for k, v in config.items()
        if k == "default_role" or k.startswith(("autodoc", "napoleon", "nitpick"))
    }
    settings = "\n".join(f"{name} = {value!r}" for name, value in chosen.items())
    (folder / "conf.py").write_text(
        CONF.format(ext=str(ROOT / "book" / "_ext"), settings=settings), encoding="utf8"
    )
    page = (ROOT / "book" / "api.md").read_text(encoding="utf8")
    (folder / "index.md").write_text(page, encoding="utf8")
    other = f"---\norphan: true\n---\n\n# Alone\n\n```{{eval-rst}}\n.. autofunction:: {ALONE}\n```\n"
    (folder / "alone.md").write_text(other, encoding="utf8")
    command = [sys.executable, "-m", "sphinx", "-q", "-b", "dummy", str(folder), str(folder / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [line for line in done.stderr.splitlines() if "WARNING" in line]


def of_the_other(complaint: str) -> bool:
    return "alone.md" in complaint or f"docstring of {ALONE}" in complaint


def test_every_name_on_the_page_is_found(complaints: list[str]) -> None:
    assert [line for line in complaints if not of_the_other(line)] == []


def test_a_name_that_no_page_has_is_told(complaints: list[str]) -> None:
    assert any("reference target not found" in line for line in complaints if of_the_other(line))
