"""Templates escape what they are given, complain about what they are not given, and are installed with the package."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import jinja2
import pytest

from inbounds.book import templates

ROOT = Path(__file__).resolve().parents[2]


def test_text_is_escaped_and_a_missing_one_is_an_error() -> None:
    assert "a &lt; b" in templates.macros("report").paragraph("a < b")
    with pytest.raises(jinja2.UndefinedError):
        templates.macros("report").paragraph()


def test_what_stands_in_a_script_does_not_end_it() -> None:
    value = {"a": "</script><b>", "µ": [1.5, None]}
    text = templates.script_json(value)
    assert "</" not in text
    assert json.loads(text) == value


def test_json_for_scripts_is_made_in_one_place() -> None:
    package = Path(templates.__file__).parent
    escaping = [path.name for path in package.rglob("*.py") if '"<\\\\/"' in path.read_text(encoding="utf8")]
    assert escaping == ["templates.py"]


def test_the_report_needs_no_more_than_its_extra() -> None:
    """Matplotlib and Jinja2: the book's own libraries are made impossible to import."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf8"))["project"][
        "optional-dependencies"
    ]
    assert [each.partition(">")[0] for each in extras["report"]] == ["jinja2", "matplotlib"]
    code = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("IPython", "bokeh", "mediapy", "jupyter_book", "ipykernel", "sphinx", "yaml"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Absent())
from inbounds.book.report.study_report import write_report
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
