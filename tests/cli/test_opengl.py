"""An OpenGL that MuJoCo cannot be imported with ends only what needs MuJoCo, and with a line instead of a traceback."""

import sys
from pathlib import Path

import pytest

from tests.test_headless import hiding, run

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="as MUJOCO_GL")

SHIPPED = Path(__file__).resolve().parents[2] / "results"
CELL = "standard-hopper-ppo-beta"
WITHOUT_MUJOCO = [
    ["--help"],
    ["train", "--help"],
    ["study", "--help"],
    ["study", "status", "--results", str(SHIPPED)],
    ["watch", "no/such/run"],
]
WITH_MUJOCO = [
    ["train", "Hopper-v5"],
    ["train", "Reacher-v5"],  # Gymnasium imports MuJoCo for this one
    ["watch", str(SHIPPED / "policies" / f"{CELL}.safetensors")],
    ["study", "verify", CELL, "--results", str(SHIPPED), "--epochs", "1"],
]


@pytest.mark.parametrize(("backend", "hidden"), [("nonsense", ()), ("osmesa", ("OSMesa",))])
def test_only_what_needs_mujoco_fails_and_it_says_why(backend: str, hidden: tuple, tmp_path) -> None:
    code = hiding(*hidden) + (
        "import sys; from inbounds.cli import main\n"
        f"for words in {WITHOUT_MUJOCO + WITH_MUJOCO}:\n"
        "    code = main(words)\n"
        "    print('CODE', code, flush=True); print('AFTER', *words, file=sys.stderr, flush=True)\n"
    )
    printed = run(code, tmp_path, MUJOCO_GL=backend)
    codes = [int(line.split()[1]) for line in printed.splitlines() if line.startswith("CODE ")]
    assert codes == [0, 0, 0, 0, 1] + [1] * len(WITH_MUJOCO)
    complaints = [line for line in printed.splitlines() if f"with MUJOCO_GL={backend}" in line]
    assert len(complaints) == len(WITH_MUJOCO)
    assert all(line.startswith("inbounds: MuJoCo cannot be imported") for line in complaints)
    assert all("unset it and start Python again" in line for line in complaints)
    assert "Traceback" not in printed


def test_an_error_of_something_else_keeps_its_name() -> None:
    from inbounds.headless import naming_the_backend

    with pytest.raises(AttributeError, match="split"), naming_the_backend():
        (1).split()  # type: ignore[attr-defined]
