"""PPO and TRPO from blanks: empty they run, filled with the chapter's functions they pass, and the folds tell true."""

import ast
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest
import torch

from inbounds.book.exercises import ppo, trpo
from inbounds.book.exercises.checks.small_updates import PPO, Small
from inbounds.book.exercises.judging import Judgement
from inbounds.book.pages import programs
from tests.book import by_hand
from tools import student_copies

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
BUILDS = {
    f"build_{name}.ipynb": NOTEBOOKS.parent / "tools" / "build" / f"{name}.ipynb" for name in ("ppo", "trpo")
}


def prose_of(name: str) -> str:
    """The text of a notebook with blanks."""
    found = nbformat.read(BUILDS[f"build_{name}.ipynb"], as_version=4).cells
    return "\n\n".join(cell.source for cell in found if cell.cell_type == "markdown")


def cells(name: str, filled: bool) -> list[str]:
    """The code of a notebook from blanks, filled with the blocks of the chapter's program or not."""
    notebook = nbformat.read(BUILDS[f"build_{name}.ipynb"], as_version=4)
    blocks = programs.program_of(NOTEBOOKS / f"{name}.ipynb").blocks
    found = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            blank = filled and "blank" in cell.metadata.get("tags", [])
            names = [node.name for node in ast.parse(cell.source).body if hasattr(node, "name")]
            found.append("\n\n".join(blocks[each] for each in names) if blank else cell.source)
    return found


def run(sources: list[str]) -> tuple[dict[str, Any], list[Any]]:
    """Run cells, and return what they leave and what their last lines show; the reward is not collected."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    shown = []
    for source in sources:
        tree = ast.parse(source)
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "a cell", "exec"), namespace)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), "a cell", "eval"), namespace))
        namespace["train"] = lambda *_, **__: "trained"
    return namespace, [each for each in shown if isinstance(each, Judgement)]


@pytest.mark.parametrize(("name", "graders"), [("ppo", 5), ("trpo", 5)])
def test_unanswered_every_grader_waits(name: str, graders: int) -> None:
    namespace, verdicts = run(cells(name, filled=False))
    assert len(verdicts) == graders
    assert [verdict.passed for verdict in verdicts] == [None] * graders
    assert "learned" not in namespace


@pytest.mark.parametrize("name", ["ppo", "trpo"])
def test_filled_every_grader_passes_and_the_reward_is_due(name: str) -> None:
    namespace, verdicts = run(cells(name, filled=True))
    assert [verdict.passed for verdict in verdicts] == [True] * 5, verdicts
    assert namespace["learned"] == "trained"


@pytest.mark.parametrize("name", ["ppo", "trpo"])
def test_signatures_are_the_program_s(name: str) -> None:
    blocks = programs.program_of(NOTEBOOKS / f"{name}.ipynb").blocks
    for source in cells(name, filled=False):
        for node in ast.parse(source).body:
            if not isinstance(node, ast.FunctionDef) or node.name == "train":  # whose horizon is shorter
                continue
            (ours,) = ast.parse(blocks[node.name]).body
            assert isinstance(ours, ast.FunctionDef)
            assert ast.unparse(node.args) == ast.unparse(ours.args)


@pytest.mark.parametrize("name", ["ppo", "trpo"])
def test_ninety_minutes_and_a_fold_for_five_errors(name: str) -> None:
    text = prose_of(name)
    assert 70 <= sum(map(int, re.findall(r"^## .*\((\d+) minutes\)$", text, re.M))) <= 90
    assert len(re.findall(r"<summary>Help: ", text)) == text.count("</details>") >= 5
    stored = nbformat.read(BUILDS[f"build_{name}.ipynb"], as_version=4).cells
    blanks = [cell for cell in stored if "blank" in cell.metadata.get("tags", [])]
    nodes = [node for cell in blanks for node in ast.walk(ast.parse(cell.source))]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    assert len(functions) >= 5
    assert all(ast.get_docstring(function) for function in functions)  # shapes, and a hint


def test_they_are_handed_out_and_kept(tmp_path: Path) -> None:
    copies = student_copies.chapters_in_order()
    assert {name: copies[name] for name in BUILDS} == BUILDS
    assert set(student_copies.hand_out(BUILDS, tmp_path).values()) == {"new"}
    for name in BUILDS:
        notebook = nbformat.read(tmp_path / name, as_version=4)
        nbformat.validate(notebook)
        assert sum(cell.cell_type == "code" for cell in notebook.cells) > 8
    assert set(student_copies.hand_out(BUILDS, tmp_path).values()) == {"unchanged"}
    mine = tmp_path / "build_ppo.ipynb"
    mine.write_text(mine.read_text().replace("return ...", "return 1"))
    assert student_copies.hand_out(BUILDS, tmp_path)["build_ppo.ipynb"] == "kept"


def changed(name: str, block: str, old: str, new: str) -> dict[str, Any]:
    """The program of a chapter with a slip in one function."""
    text = programs.assemble(NOTEBOOKS / f"{name}.ipynb")
    before = programs.program_of(NOTEBOOKS / f"{name}.ipynb").blocks[block]
    assert old in before
    return by_hand.run(text.replace(before, before.replace(old, new)))


@pytest.mark.parametrize(
    ("name", "block", "old", "new", "message"),
    [
        ("ppo", "update", ".detach()", "", "Trying to backward through the graph a second time"),
        ("ppo", "surrogate", ".mean()", "", "grad can be implicitly created only for scalar outputs"),
        ("ppo", "normalized", "x.std()", "...", "unsupported operand type(s)"),
        ("ppo", "update", "advantage[index]", "advantage", "The size of tensor a (16) must match"),
        ("ppo", "update", "advantages(batch, critic)", "...", "cannot unpack non-iterable ellipsis object"),
        ("trpo", "update", "batch.latent).detach()", "batch.latent)", "Expected parameter loc"),
        ("trpo", "update", "batch.obs).mean()", "batch.obs)", "grad can be implicitly created only for scalar outputs"),
        ("trpo", "natural_step", ", create_graph=True", "", "element 0 of tensors does not require grad"),
        ("trpo", "natural_step", ", retain_graph=True", "", "Trying to backward through the graph a second time"),
    ],
)  # fmt: skip
def test_the_folds_quote_what_python_says(name: str, block: str, old: str, new: str, message: str) -> None:
    """Each slip raises the error of its fold, and the fold is in the notebook."""
    program, small = changed(name, block, old, new), Small()
    with pytest.raises((RuntimeError, TypeError, ValueError)) as raised:
        program["update"](small.policy, small.critic, small.adam(PPO), small.batch, passes=2, size=16)
    assert message in str(raised.value)
    summaries = re.sub(r"</?code>", "", prose_of(name))
    assert re.search(rf"Help: (later )?I get ([^<]* or )?{re.escape(message)}", summaries)
    assert ". " in {"ppo": ppo, "trpo": trpo}[name].update(program["update"]).message  # with its meaning


@pytest.mark.parametrize(("name", "blank"), [("ppo", "advantages"), ("trpo", "conjugate_gradient")])
def test_one_blank_can_be_left_out(name: str, blank: str) -> None:
    """The fold's lines stand in for the cell, and everything after it passes."""
    lines = f'whole = {{}}\nprograms.start(whole, "{name}")\n{blank} = whole["{blank}"]'
    assert f"```python\n{lines}\n```" in prose_of(name)
    sources = [lines if f"def {blank}(" in each else each for each in cells(name, filled=True)]
    assert lines in sources
    assert [verdict.passed for verdict in run(sources)[1]] == [True] * 5


def test_a_step_with_a_number_for_each_motor_meets_the_advantages_badly() -> None:
    """The first fold of PPO; with one motor nothing is raised."""
    ratio, advantage = torch.ones(64, 6), torch.ones(64)
    with pytest.raises(
        RuntimeError, match=r"The size of tensor a \(6\) must match the size of tensor b \(64\)"
    ):
        _ = ratio * advantage
    assert (torch.ones(64, 1) * advantage).shape == (64, 64)


def test_a_vanished_residual_is_not_a_number() -> None:
    program = changed("trpo", "conjugate_gradient", "square < 1e-10", "False")
    b = torch.ones(3)
    assert program["conjugate_gradient"](lambda v: 2 * v, b).isnan().all()


def test_a_gain_computed_beforehand_moves_nothing() -> None:
    """Its fold is in the notebook, with the grader's words."""
    slip = "value = surrogate(policy, batch, weight, old_log_prob)\n\n    def gain():\n        return value"
    right = "def gain():\n        return surrogate(policy, batch, weight, old_log_prob)"
    verdict = trpo.update(changed("trpo", "update", right, slip)["update"])
    assert verdict.passed is False
    assert "the policy has not moved" in verdict.message
    assert "“the policy has not moved”" in prose_of("trpo")


def test_the_other_folds_quote_their_graders() -> None:
    text = prose_of("ppo")
    assert "take the smaller of the two products, not of the two ratios" in text
    wrong = changed("ppo", "surrogate", "torch.minimum(ratio * advantage, clipped * advantage)",
                    "(torch.minimum(ratio, clipped) * advantage)")["surrogate"]  # fmt: skip
    assert "not of the two ratios" in ppo.surrogate(wrong).message
    weak = changed("trpo", "line_search", "\n    vector_to_parameters(start, weights)", "")["line_search"]
    assert "yet the weights moved" in trpo.line_search(weak).message
