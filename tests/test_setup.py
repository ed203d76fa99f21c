"""`tools/setup.sh` on a folder whose `.venv` is a link to another environment."""

import shutil
import subprocess
from pathlib import Path

SETUP = Path(__file__).resolve().parents[1] / "tools" / "setup.sh"


def test_an_environment_behind_a_link_is_left_as_it_is(tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "kept").write_text("packages", encoding="utf-8")
    (tmp_path / "clone" / "tools").mkdir(parents=True)
    shutil.copy(SETUP, tmp_path / "clone" / "tools")
    for name in ("pyproject.toml", "constraints.txt", "apt.txt"):
        shutil.copy(SETUP.parents[1] / name, tmp_path / "clone")
    (tmp_path / "clone" / ".venv").symlink_to(tmp_path / "other")
    ran = subprocess.run(
        ["bash", "tools/setup.sh"],
        cwd=tmp_path / "clone",
        env={"PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1
    assert ".venv is a link" in ran.stderr
    assert "rm .venv" in ran.stderr
    assert (tmp_path / "other" / "kept").read_text(encoding="utf-8") == "packages"
