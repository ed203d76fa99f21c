"""One program grows through the book: its parts, its diffs, and its start in a notebook."""

import json
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

from inbounds.book.pages import programs
from inbounds.book.pages.blocks import Program, difference, grown, parts, text_of, without
from inbounds.book.pages.counts import count_page
from tests.book import by_hand
from tools import notebook_hook

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
NAMES = sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb") if programs.has_program(path))
WITH_EVERY_POLICY = {"policy_that_learns", "ppo"}
LAWS = ("normal", "squash", "clip", "beta", "stretch", "POLICIES")
FIRST = """import math
from torch import nn, Tensor

# what half of it is
def half(x):
    return x / 2


class Point:
    def __init__(self, x):
        self.x = x

    def double(self):
        return 2 * self.x


def train(env):
    return half(math.pi)
"""


def chapter(folder: Path, name: str, *cells: str, prose: str = "# A title", **own: Any) -> Path:
    """A notebook whose cells are all of its program."""
    stored = [{"cell_type": "markdown", "source": prose, "metadata": {}}]
    stored += [{"cell_type": "code", "source": cell, "metadata": {"tags": ["program"]}} for cell in cells]
    path = folder / f"{name}.ipynb"
    path.write_text(json.dumps({"cells": stored, "metadata": {"program": own} if own else {}}))
    return path


def test_a_block_takes_the_place_of_its_namesake() -> None:
    changed = grown(parts(FIRST), "def half(x):\n    return 0.5 * x")
    assert list(changed.blocks) == ["half", "Point", "train"]
    assert "0.5 * x" in changed.blocks["half"]
    assert "what half of it is" not in text_of(changed)  # the comment above it went with it


@pytest.mark.parametrize(
    ("cell", "order"),
    [
        ("c = 1", ["half", "Point", "c", "train"]),  # before train
        ("c = 1\nclass Point: pass", ["half", "c", "Point", "train"]),  # before what follows it in its cell
        ("c = 1\nd = 2\ndef half(): pass", ["c", "d", "half", "Point", "train"]),
        ("class Point: pass\nc = 1", ["half", "Point", "c", "train"]),
    ],
)
def test_a_new_block_goes_before_what_uses_it(cell: str, order: list[str]) -> None:
    assert list(grown(parts(FIRST), cell, "train").blocks) == order


def test_a_class_can_get_methods_and_stays_one_class() -> None:
    cell = (
        "class Point(Point):\n    def double(self):\n        return self.x + self.x\n\n"
        "    def triple(self):\n        return 3 * self.x"
    )
    program = grown(parts(FIRST), cell)
    text = program.blocks["Point"]
    assert text.count("class Point:") == text.count("def double") == 1
    point = by_hand.run(text_of(program))["Point"](2)
    assert (point.double(), point.triple(), point.x) == (4, 6, 2)
    assert "self.x + self.x" in text
    assert "\n    def __init__(self, x):\n        self.x = x\n\n    def double" in text


def test_imports_are_joined_sorted_and_used() -> None:
    more = (
        "import torch\nfrom collections import OrderedDict\nimport gymnasium as gym\n"
        "from torch.nn import functional as F, Linear\nx = torch, gym, F, Linear, OrderedDict, nn"
    )
    assert text_of(grown(parts(FIRST), more)).split("\n\n\n")[0].splitlines() == [
        "import math", "from collections import OrderedDict", "",
        "import gymnasium as gym", "import torch", "from torch import nn",  # Tensor: nothing uses it
        "from torch.nn import Linear, functional as F",
    ]  # fmt: skip


def test_blocks_are_dropped_by_name() -> None:
    assert list(without(parts(FIRST), ["half"]).blocks) == ["Point", "train"]
    with pytest.raises(ValueError, match="the program has no third"):
        without(parts(FIRST), ["third"])


def test_what_is_no_block_is_refused() -> None:
    with pytest.raises(ValueError, match=r"line 2 has none: print\(x\)"):
        parts("x = 1\nprint(x)")


def test_a_chapter_continues_another(tmp_path: Path) -> None:
    chapter(tmp_path, "one", FIRST, "def spare():\n    return 1")
    two = chapter(tmp_path, "two", "def half(x):\n    return x / 2.0", continues="one", drops=["spare"])
    three = chapter(tmp_path, "three", "import os\nhome = os.sep", continues="two")
    assert list(programs.program_of(three).blocks) == ["half", "Point", "home", "train"]
    text = programs.assemble(three)
    assert text.startswith('"""A title: the program of this chapter of In Bounds')
    assert "import math\nimport os\n" in text
    assert text.endswith("train(**vars(options))\n")
    assert "x / 2.0" in programs.assemble(two)
    assert list(programs.before(three).blocks) == list(programs.program_of(two).blocks)


def test_the_diff_names_the_blocks_that_changed(tmp_path: Path) -> None:
    chapter(tmp_path, "one", FIRST, "def spare():\n    return 1")
    cells = "c = 1", "def half(x):\n    return x / 2.0"
    two = chapter(
        tmp_path, "two", *cells, continues="one", drops=["spare"], prose="# T\n\n```{program-diff}\n```"
    )
    lines = programs.diff(two).splitlines()
    assert [line for line in lines if line.startswith("@@")] == ["@@ half @@", "@@ c @@", "@@ spare @@"]
    assert "-    return x / 2" in lines
    assert "+    return x / 2.0" in lines
    assert "-def spare():" in lines
    assert "+c = 1" in lines
    assert not any("Point" in line or "train" in line for line in lines)
    assert count_page(two).lines == len(lines) + 3  # the diff is read, and so are the cells
    with pytest.raises(ValueError, match="continues no program"):
        programs.diff(tmp_path / "one.ipynb")


def test_far_apart_changes_of_a_block_are_told_apart() -> None:
    long = "def f():\n" + "\n".join(f"    x{i} = {i}" for i in range(20))
    found = difference(parts(long), parts(long.replace("x1 ", "y ").replace("x18", "z")))
    assert [line for line in found.splitlines() if line.startswith("@@")] == [
        "@@ f @@",
        "@@ f, further down @@",
    ]
    assert difference(parts(long), parts(long)) == ""
    assert difference(Program(), parts("import os\nx = os")).startswith("@@ imports @@\n+import os\n@@ x @@")


def test_what_a_notebook_defines_anew_is_what_the_others_call(tmp_path: Path) -> None:
    chapter(tmp_path, "one", FIRST)
    namespace: dict[str, Any] = {"__name__": "__main__"}  # as in a notebook: the command line must not start
    programs.start(namespace, "one", tmp_path)
    assert namespace["train"](None) > 1.5
    exec("def half(x):\n    return 7", namespace)
    assert namespace["train"](None) == 7


def test_a_traceback_shows_the_line(tmp_path: Path) -> None:
    chapter(tmp_path, "one", FIRST)
    namespace: dict[str, Any] = {}
    programs.start(namespace, "one", tmp_path)
    with pytest.raises(TypeError) as raised:
        namespace["half"]("a word")
    assert "return x / 2" in "".join(traceback.format_tb(raised.tb))


def test_metadata_of_a_program_is_kept_and_nothing_else(tmp_path: Path) -> None:
    notebook = notebook_hook.nbformat.from_dict(
        {"cells": [], "metadata": {"program": {"continues": "a"}, "widgets": {}}}
    )
    assert set(notebook_hook.strip(notebook).metadata) == {"kernelspec", "language_info", "program"}


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_clean(tmp_path: Path, name: str) -> None:
    """Imports sorted and used, no name undefined, laid out as the cells are."""
    file = tmp_path / f"{name}.py"
    file.write_text(programs.assemble(NOTEBOOKS / f"{name}.ipynb"), encoding="utf8")
    for how in (["check", "--select", "F,I"], ["format", "--check", "--diff", "--config", "line-length=88"]):
        command = [sys.executable, "-m", "ruff", *how, "--isolated", str(file)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    assert "inbounds" not in file.read_text().lower().replace("in bounds", "")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("robot", ["InvertedPendulum-v5", "HalfCheetah-v5"])
def test_every_program_trains_on_every_robot(name: str, robot: str) -> None:
    """One batch each; `test_program_in_sixty_lines.py` shows that a file learns, alone in a folder.

    Two programs with every policy: the others share theirs with one of the two, as the next test has it.
    """
    program = by_hand.run(programs.assemble(NOTEBOOKS / f"{name}.ipynb"))
    box = gym.make(robot).action_space
    policies = list(program["POLICIES"].values())
    for policy in policies if name in WITH_EVERY_POLICY else policies[-1:]:
        scores: list[int] = []
        learned = program["train"](
            robot, policy, epochs=1, tell=lambda _, score, to=scores: to.append(score)
        )[0]
        obs, _ = gym.make(robot).reset(seed=0)
        action = learned.to_box(learned.sample(program["torch"].tensor(obs).float()))
        assert len(scores) == 1
        assert (box.low <= action).all()
        assert (action <= box.high).all()


def test_no_program_has_laws_of_its_own_but_two() -> None:
    def laws(name: str) -> dict[str, str]:
        blocks = programs.program_of(NOTEBOOKS / f"{name}.ipynb").blocks
        return {each: blocks[each] for each in LAWS if each in blocks}

    of_two = [laws(name) for name in WITH_EVERY_POLICY]
    assert all("POLICIES" in laws(name) and laws(name) in of_two for name in NAMES)
