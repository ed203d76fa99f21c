"""The grade of a finding is decided in one place, and changes when cells arrive."""

import dataclasses

import pytest

from inbounds.book.report import answers, winners
from inbounds.book.report.equal_start import (
    Evidence,
    exploratory,
    grade,
    laws,
    outcomes_of_both,
    quiet_starts,
)
from inbounds.study import statistics
from inbounds.study.grid import AFTERWARDS, ROBOTS, SECOND, select
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import GAUSSIAN, Pair, compared
from inbounds.study.store import StudyFolder
from tests.book.report.made_up import gap
from tests.study.small import folder_in
from tests.study.synthetic import write_cells

CLEAR = Evidence("Ant", "ppo", "beta", "final", gap(300, 900), study=1)
SECOND_ONE = dataclasses.replace(CLEAR, study=2, p_adjusted=0.01, primary=True)


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({}, "suggested"),
        ({"p_adjusted": 0.01}, "found"),
        ({"p_adjusted": 0.2}, "suggested"),
        ({"difference": gap(-1, 900)}, "no difference found"),
        ({"difference": gap(-1, 900), "p_adjusted": 0.01}, "no difference found"),
        ({"difference": gap(1, 900)}, "no difference found"),  # the resampling's luck reaches as far as 0
    ],
)
def test_grades_of_the_first_study(changed: dict, word: str) -> None:
    assert grade(dataclasses.replace(CLEAR, **changed)) == word


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({}, "found"),
        ({"whole": False}, "suggested"),
        ({"p_adjusted": 0.2}, "suggested"),
        ({"difference": gap(-900, -300)}, "found"),
        ({"difference": gap(10, 90)}, "too small to matter"),
        ({"difference": gap(-90, 90)}, "too small to matter"),
        ({"difference": gap(-90, 90), "whole": False}, "no difference found"),
        ({"difference": gap(10, 90), "primary": False}, "found"),
        ({"difference": gap(-90, 900)}, "found"),  # the protocol's test decides
        ({"difference": gap(-90, 900), "p_adjusted": 0.2}, "no difference found"),
    ],
)
def test_grades_of_the_second_study(changed: dict, word: str) -> None:
    assert grade(dataclasses.replace(SECOND_ONE, **changed)) == word


def test_what_is_too_small_to_matter_is_not_called_no_difference() -> None:
    small = dataclasses.replace(SECOND_ONE, difference=gap(10, 90))
    assert winners.field([small]) == "too small to matter; logit-normal not run"


def test_each_difference_is_told_with_its_grade() -> None:
    changes = {
        "Hopper": {},
        "Ant": {"difference": gap(10, 90)},
        "Swimmer": {"whole": False},
        "Walker2d": {"whole": False, "difference": gap(-900, -300)},
        "Humanoid": {"difference": gap(-90, 900), "p_adjusted": 0.2},
        "HalfCheetah": {"difference": gap(-9000, -3000)},
    }
    rows = [dataclasses.replace(SECOND_ONE, robot=robot, **changed) for robot, changed in changes.items()]
    assert answers.counted(rows) == (
        "above on 1 of 6 robots (Hopper), below on 1 (HalfCheetah), suggested above on 1 (Swimmer), "
        "suggested below on 1 (Walker2d), too small to matter on 1 (Ant), no difference found on 1"
    )
    assert answers.found(rows) == "found above on 1 of 6 robots (Hopper), below on 1 (HalfCheetah)"
    assert [bar.group for bar in answers.bars(rows) if not bar.hollow] == ["Hopper", "HalfCheetah"]


def test_a_row_of_the_table_says_on_which_side_of_zero_a_difference_is() -> None:
    rows = [
        SECOND_ONE,
        dataclasses.replace(SECOND_ONE, robot="Swimmer", whole=False, difference=gap(-900, -300)),
        dataclasses.replace(SECOND_ONE, robot="Ant", difference=gap(10, 90)),
    ]
    assert [answers._told(each) for each in rows] == [
        "above, found",
        "below, suggested",
        "too small to matter",
    ]
    table = answers.by_endpoint(rows, SECOND_ONE.algorithm).html.partition("<tbody>")[2]
    assert '<th scope="row" class="words">Swimmer</th>' in table
    assert "<br>below, suggested</td>" in table


def test_a_hollow_marker_is_the_first_study_where_there_are_both() -> None:
    rows = [
        SECOND_ONE,
        dataclasses.replace(SECOND_ONE, whole=False),
        dataclasses.replace(SECOND_ONE, study=1),
    ]
    assert [bar.hollow for bar in answers.bars(rows, both_studies=True)] == [False, False, True]
    both, one = (answers.by_endpoint(part, SECOND_ONE.algorithm)._repr_html_() for part in (rows, rows[:2]))
    assert "Hollow: the first study" in both
    assert "Filled: found by a corrected test. Hollow: not." in one
    untested = answers._caption({"": [dataclasses.replace(SECOND_ONE, p_adjusted=float("nan"))]})
    assert "All markers are hollow: no corrected test of these differences was planned." in untested


@pytest.fixture
def folder(tmp_path) -> StudyFolder:
    """Of the first study: quiet and plain Gaussian, Beta as it comes, on Ant under PPO."""
    found = folder_in(tmp_path)
    quiet = [cell for cell in AFTERWARDS if cell.id == "afterwards-ant-ppo-gaussian-matched-noise"]
    write_cells(found, [*select(["standard-ant-ppo-gaussian", "standard-ant-ppo-beta"]), *quiet])
    return found


def of_the_beta(folder: StudyFolder) -> Evidence:
    (found,) = answers.of(
        laws(outcomes_of_both(Outcomes.read(folder))), law="beta", endpoint="final", robot="Ant"
    )
    return found


def test_the_grade_changes_as_cells_arrive(folder: StudyFolder) -> None:
    found = of_the_beta(folder)
    assert (found.study, found.as_it_comes, grade(found)) == (1, True, "suggested")
    names = ("equal-ant-ppo-gaussian-free-std", "equal-ant-ppo-beta")
    first, *rest = [cell for cell in SECOND["B"] if cell.id in names]
    write_cells(folder, [first])
    assert of_the_beta(folder) == found  # one side alone says nothing
    write_cells(folder, rest)
    half = of_the_beta(folder)
    assert (half.study, half.whole, half.difference.n, grade(half)) == (2, False, 10, "suggested")
    more = ("equal-more-ant-ppo-gaussian-free-std", "equal-more-ant-ppo-beta")
    write_cells(folder, [cell for cell in SECOND["B, more seeds"] if cell.id in more])
    whole = of_the_beta(folder)
    assert (whole.whole, whole.difference.n, grade(whole)) == (True, 20, "found")


def test_what_no_protocol_tests_is_not_tested(folder: StudyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("equal-ant-ppo-gaussian-free-std", "equal-ant-ppo-beta")
    write_cells(folder, [cell for cell in SECOND["B"] if cell.id in names])
    outcomes = outcomes_of_both(Outcomes.read(folder))
    expected = compared(outcomes, Pair(Column("equal", "ppo", "beta"), GAUSSIAN), "final")["Ant"]
    monkeypatch.setattr(statistics, "permutation_test", lambda *_, **__: pytest.fail("permuted"))
    (found,) = exploratory(outcomes, GAUSSIAN, "final")
    assert (found.difference, found.whole) == (expected.difference, False)


def test_a_quiet_start_waits_for_the_second_study(folder: StudyFolder) -> None:
    def found() -> Evidence:
        (row,) = answers.of(
            quiet_starts(outcomes_of_both(Outcomes.read(folder))), robot="Ant", endpoint="final"
        )
        return row

    assert (found().study, found().algorithm) == (1, "ppo")
    names = ("equal-ant-ppo-gaussian-free-std", "as-they-come-ant-ppo-gaussian-free-std")
    cells = [cell for block in ("B", "D") for cell in SECOND[block] if cell.id in names]
    write_cells(folder, cells)
    assert (found().study, found().whole) == (2, False)  # ten more seeds of the quiet one are planned


def row(law: str, low: float, high: float, robot: str = "Ant") -> Evidence:
    return Evidence(robot, "ppo", law, "final", gap(low, high), study=1)


@pytest.mark.parametrize(
    ("rows", "law"),
    [
        ([], ""),
        ([row("beta", 100, 900)], "beta"),
        ([row("beta", 100, 900), row("beta", -900, -100, "Hopper")], ""),
        ([row("beta", 100, 900), row("logit-normal", 100, 900)], ""),
        (
            [row("beta", 100, 900), row("logit-normal", 100, 900), row("logit-normal", 100, 900, "Hopper")],
            "logit-normal",
        ),
        ([row("beta", 100, 900), row("logit-normal", -900, -100)], "beta"),
        ([row("beta", -100, 900)], ""),
    ],
)
def test_the_first_choice_follows_from_the_numbers(rows: list[Evidence], law: str) -> None:
    assert answers.first_choice(rows) == law


def test_advice_waits_until_every_law_was_compared_on_every_robot() -> None:
    rows = [row(law, 100, 900, robot) for law in ("beta", "logit-normal") for robot in ROBOTS]
    rows = [row("logit-normal", -900, -100), *rows]
    assert answers.advice(rows, "ppo") == "Under PPO, try the Beta."
    assert answers.advice(rows[:-1], "ppo") == "Under PPO too few robots have run: keep your library's law."
    behind = [*rows, row("beta", -900, -100)]
    assert answers.advice(behind, "ppo") == "Under PPO no law leads: keep your library's law."
    assert answers.advice(rows[1:], "ppo") == "Under PPO both laws lead alike: keep your library's law."


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ([(100, 900), (-100, 900)], "Start quietly."),
        ([(100, 900), (100, 900), (-900, -100)], "Try a quiet start."),
        ([(100, 900), (-900, -100)], "Keep the usual start."),
        ([(-100, 900)], "Keep the usual start."),
    ],
)
def test_a_quiet_start_is_advised_as_firmly_as_it_helps(ends: list[tuple[float, float]], said: str) -> None:
    assert answers.start_advice([row("gaussian", *each) for each in ends]) == said


def test_what_is_too_small_to_matter_leads_nowhere() -> None:
    small = dataclasses.replace(SECOND_ONE, difference=gap(10, 90))
    assert answers.first_choice([small]) == ""
    assert answers.first_choice([SECOND_ONE]) == "beta"


def test_the_forest_says_what_is_there_and_what_is_not(folder: StudyFolder) -> None:
    rows = laws(outcomes_of_both(Outcomes.read(folder)))
    shown = answers.by_algorithm(rows).html
    assert "Beta − Gaussian" in shown
    assert "With its usual start, somewhat louder than 0.4: Ant, Beta (PPO)." in shown
    assert "Not run from an equal start." in shown
    assert "Ant (Logit-normal)" in shown
    assert "missing" in answers.by_algorithm([]).html
    assert repr(answers.by_algorithm(rows)) == repr(
        answers.by_algorithm([])
    )  # a stored notebook stays as it is
