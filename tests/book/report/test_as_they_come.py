"""What the first study compares: many resamples, findings that a wider correction would not make, and their words."""

import dataclasses

import pytest

from inbounds.book.report import as_they_come as views
from inbounds.book.report import study_pages
from inbounds.study.analysis import Contrast
from inbounds.study.grid import select
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics import Comparison, Estimate
from tests.book.report.made_up import gap
from tests.study.small import folder_in
from tests.study.synthetic import write_cells

BETA = Contrast("standard", "ppo", "beta", "gaussian")


CLEAR = gap(1, 9)


def row(difference: Estimate = CLEAR, p: float = 0.01, over_all: float = 0.01) -> views.Compared:
    return views.Compared(BETA, "final", "Ant", difference, Comparison(gap(1, 9), p, p), over_all)


@pytest.mark.parametrize(
    ("compared", "found", "fragile", "changed"),
    [
        (row(), True, False, False),
        (row(over_all=0.2), True, True, False),
        (row(p=0.2, over_all=0.2), False, False, False),
        (row(gap(-1, 9)), False, False, True),
        (row(gap(-9, -1)), True, False, True),
    ],
)
def test_found_fragile_changed(compared: views.Compared, found: bool, fragile: bool, changed: bool) -> None:
    assert (compared.found, compared.fragile, compared.changed) == (found, fragile, changed)


def test_words() -> None:
    hopper = dataclasses.replace(row(over_all=0.2), robot="Hopper")
    assert views.told([row(), hopper, row(gap(-1, 9))]) == (
        "above on 2 of 3 robots (Ant, Hopper†), no difference found on 1"
    )
    assert views.changed_words([row(gap(-1, 9))]) == [
        "PPO, standard practice, Beta − Gaussian, Ant, final return: higher → unresolved"
    ]
    assert views.worst_end([row(gap(1, 11))]) == pytest.approx(0.2)


def test_what_is_not_finished_is_named(tmp_path) -> None:
    folder = folder_in(tmp_path)
    write_cells(folder, select(["standard-ant-ppo-beta", "standard-ant-ppo-gaussian"]))
    rows = views.compared(Outcomes.read(folder), "standard")
    assert [(each.robot, each.endpoint, each.contrast) for each in rows] == [
        ("Ant", "final", BETA),
        ("Ant", "area", BETA),
    ]
    assert all(each.difference.n == 10 for each in rows)
    shown = views.comparisons(rows, "standard", "ppo").html
    assert "Logit-normal − Gaussian: HalfCheetah, Hopper" in shown
    assert "missing" in views.comparisons(rows, "standard", "trpo").html


def test_no_verdict_of_the_shipped_study_hangs_on_the_number_of_resamples() -> None:
    """`results/HISTORY.md` says so: with another answer it lists what changes."""
    outcomes = study_pages.shipped()
    rows = [each for arm in ("standard", "printed", "beyond") for each in views.compared(outcomes, arm)]
    assert views.changed_words(rows) == []
    assert views.worst_end(rows) < 0.05
