"""Who wins, in words: the laws by their intervals, what was not run, and links to a place that exists."""

import re
from pathlib import Path

import nbformat
import numpy as np
import pytest

from inbounds.book.report import answers, winners
from inbounds.book.report.equal_start import Evidence
from inbounds.study.grid import ROBOTS
from inbounds.study.statistics import Estimate

ROOT = Path(__file__).resolve().parents[3]


def row(
    law: str, low: float, high: float, robot: str = "Ant", algorithm: str = "ppo", p: float = 0.001
) -> Evidence:
    middle = (low + high) / 2
    gap = Estimate(*map(np.array, (middle, low, high)), 10, 0, 0.95, "difference of means")
    return Evidence(robot, algorithm, law, "final", gap, study=1, p_adjusted=p)


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([], "not run"),
        ([row("beta", -5, 5), row("logit-normal", -5, 5)], "no difference found"),
        (
            [row("beta", 4, 9), row("logit-normal", -5, 5)],
            "Beta above (found); logit-normal: no difference found",
        ),
        (
            [row("beta", -9, -4), row("logit-normal", 4, 9, p=0.5)],
            "logit-normal above (suggested); Beta below (found)",
        ),
        ([row("logit-normal", -5, 5)], "no difference found; Beta not run"),
    ],
)
def test_a_field_says_who_wins(rows: list[Evidence], told: str) -> None:
    assert winners.field(rows) == told


def test_the_table_has_every_robot_and_links() -> None:
    page = winners.winners([row("beta", 4, 9), row("logit-normal", 4, 9, algorithm="trpo")]).html
    assert page.count("<a href=") == 2 * len(ROBOTS)
    assert page.count(">not run<") == 2 * len(ROBOTS) - 2
    assert all(f'<th scope="row">{robot}</th>' in page for robot in ROBOTS)
    assert "none of these cells is finished" in winners.winners([]).html


def test_each_field_leads_to_the_row_of_its_robot_and_algorithm() -> None:
    """Where the chapter shows it: a row that names both, and has the numbers of the field's difference."""
    rows = [row("beta", 4, 9), row("logit-normal", -5, 5, robot="Hopper", algorithm="trpo")]
    targets = re.findall(r'<a href="(.*?)#(.*?)">', winners.winners(rows).html)
    assert [page for page, _ in targets] == ["what_happened.html"] * len(targets)
    shown = "".join(answers.by_endpoint(rows, algorithm).html for algorithm in winners.ALGORITHMS)
    names = [(robot, algorithm) for robot in ROBOTS for algorithm in winners.ALGORITHMS]
    for (robot, algorithm), (_, anchor) in zip(names, targets, strict=True):
        (text,) = re.findall(rf'<tr id="{anchor}">(.*?)</tr>', shown, re.S)
        assert f">{robot}<" in text
        assert f"-{algorithm}-" in anchor
        run = (robot, algorithm) in {("Ant", "ppo"), ("Hopper", "trpo")}
        assert text.count(">not run<") == (3 if run else 4)
    assert "6.5\N{NO-BREAK SPACE}[4.0,\N{NO-BREAK SPACE}9.0]<br>above, found" in shown
    cells = nbformat.read(ROOT / "notebooks" / "what_happened.ipynb", as_version=4).cells
    sources = [cell.source for cell in cells if cell.cell_type == "code"]
    for algorithm in winners.ALGORITHMS:
        assert f'answers.by_endpoint(rows, "{algorithm}")' in sources
