"""Who wins, in words: the laws by their intervals, what was not run, and links to a place that exists."""

from pathlib import Path

import nbformat
import numpy as np
import pytest

from inbounds.book.report import winners
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


def test_the_evidence_is_where_the_links_lead() -> None:
    name, _, anchor = winners.EVIDENCE.partition(".html#")
    cells = nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4).cells
    headings = [line for cell in cells if cell.cell_type == "markdown" for line in cell.source.splitlines()]
    assert f"## {anchor.replace('-', ' ').capitalize()}" in headings


def test_the_finding_follows_the_rows() -> None:
    rows = [row("beta", 4, 9), row("beta", -5, 5, robot="Hopper")]
    said = winners.finding(winners.by_test(["higher", "lower", ""]), rows, "beta", "ppo")
    assert said == (
        "Under PPO the Beta ends above the clipped Gaussian on 1 of 3 robots, and below it on 1 (found). "
        "When both start equally quiet, the Beta ends above on 1 of 2 robots, and below on none (found on 1)."
    )
    assert "(" not in winners.finding("x", rows[1:], "beta", "ppo").partition("quiet")[2]
    assert "not compared yet" in winners.finding("x", [], "beta", "ppo")
