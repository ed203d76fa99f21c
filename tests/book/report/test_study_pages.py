"""The chapters' views of the study: the report's own parts, the same stored text with cells and without."""

import dataclasses
import re
from collections import Counter
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.explorer.claims import claims
from inbounds.book.report import arms, ledger_table, study_pages
from inbounds.book.report.changes import GROUPS
from inbounds.book.report.html import Shown, together
from inbounds.book.report.score_tables import PUBLISHED, THESIS
from inbounds.book.report.study_report import write_report
from inbounds.book.report.words import pair_name
from inbounds.study import analysis, select
from inbounds.study.analysis import CONTRASTS, Contrast
from inbounds.study.grid import ROBOTS
from inbounds.study.ledger import CLAIMS, Finding, claims_named, computed, judge, quotes
from inbounds.study.outcomes import Outcomes
from inbounds.study.words import spoken, verdict
from tests.study.small import folder_in
from tests.study.synthetic import write_cells

CHEAP = claims_named(["wins-ppo-standard", "start-raw", "clip", "beta-hessian", "centres"])


@pytest.fixture(scope="module")
def nothing(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    return Outcomes.read(folder_in(tmp_path_factory.mktemp("nothing")))


@pytest.fixture(scope="module")
def some(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    """PPO of arm 1 on two robots, and one changed cell."""
    folder = folder_in(tmp_path_factory.mktemp("some"))
    write_cells(
        folder,
        select(["standard-hopper-ppo-*", "standard-ant-ppo-*", "mechanisms-hopper-ppo-beta-entropy-0"]),
    )
    return Outcomes.read(folder)


def views(outcomes: Outcomes) -> list[Shown]:
    found = [judge(outcomes, claim) for claim in CHEAP]
    return [
        study_pages.state(outcomes),
        study_pages.provenance(outcomes),
        study_pages.curves(outcomes, "standard", "ppo"),
        study_pages.endpoints(outcomes, "standard", "ppo"),
        study_pages.difference_table(outcomes, "standard", "ppo"),
        study_pages.inside(outcomes, "standard", "ppo"),
        study_pages.over_all_robots(outcomes, "standard"),
        study_pages.ways(outcomes),
        *(study_pages.changes(outcomes, word) for word in GROUPS),
        study_pages.score_sheet(outcomes),
        study_pages.found_differences(outcomes, "standard"),
        study_pages.published(outcomes),
        study_pages.ledger(found),
        claims(found),
        study_pages.decided(found),
    ]


def test_the_stored_text_does_not_change_when_cells_arrive(nothing: Outcomes, some: Outcomes) -> None:
    before, after = views(nothing), views(some)
    assert [repr(view) for view in before] == [repr(view) for view in after]
    assert [view.html for view in before] != [view.html for view in after]
    for view in before[:1] + before[2:-1]:
        assert "missing" in view.html or "0 of" in view.html, view
    # GROUPS names the discount, a number that is fixed; no other text holds any.
    assert not any(c.isdigit() for view in after if "discount" not in repr(view) for c in repr(view))


@pytest.mark.slow
def test_the_chapters_show_what_the_report_shows(some: Outcomes, tmp_path: Path) -> None:
    report = write_report(some, tmp_path / "report.html").read_text(encoding="utf8")
    for view in (study_pages.state(some), study_pages.difference_table(some, "standard", "ppo")):
        tables = [part for part in view.parts if part.startswith('<div class="table"')]
        assert tables
        assert all(table in report for table in tables)
    assert report.count("inbounds study ledger ") == len(CLAIMS)


def cells(view: Shown) -> list[list[str]]:
    return [
        [
            unescape(cell.partition(">")[2].partition("</t")[0].replace("<br>", "\n"))
            for cell in re.split("<t[hd]", row)[1:]
        ]
        for row in view.html.partition("<tbody>")[2].split("<tr>")[1:]
    ]


def test_the_score_sheet_counts_every_robot_once(some: Outcomes) -> None:
    sheet = study_pages.score_sheet(some)
    rows = cells(sheet)
    assert 0 < len(rows) < len(CONTRASTS)
    assert all(sum(map(int, row[2:7])) == len(ROBOTS) for row in rows)
    waiting = sheet.html.partition("missing on all robots: ")[2].partition(".</p>")[0].split("; ")
    assert len(rows) + len(waiting) == len(CONTRASTS)
    assert "TRPO, standard practice, Logit-normal − Gaussian" in waiting
    first = rows[0]
    assert first[:2] == ["PPO, standard practice", "Logit-normal − Gaussian"]
    assert first[2:7] == ["2", "0", "0", "0", "4"]  # 500 apart, noise 150: found on both robots
    assert first[7] == THESIS["ppo", "logit-normal", "gaussian"]


def test_the_differences_found_are_those_that_the_score_sheet_counts(some: Outcomes) -> None:
    rows = cells(study_pages.found_differences(some, "standard"))
    names = [row[0].split("\n") for row in rows]
    assert {name for name, _ in names} <= {"Hopper, PPO", "Ant, PPO"}
    by_pair = Counter(
        pair
        for (_, pair), row in zip(names, rows, strict=True)
        if "\nhigher\np " in row[1] or "\nlower\np " in row[1]
    )
    counted = {row[1]: int(row[2]) + int(row[3]) for row in cells(study_pages.score_sheet(some))[:3]}
    assert {pair: by_pair[pair] for pair in counted} == counted
    contrast = Contrast("standard", "ppo", "logit-normal", "gaussian")
    (row,) = [row for row in rows if row[0] == f"Hopper, PPO\n{pair_name(contrast)}"]
    for text, endpoint in zip(row[1:], analysis.ENDPOINTS, strict=True):
        expected = analysis.differences(some, contrast, endpoint)["Hopper"]
        assert text.replace("\n[", " [").startswith(
            f"{together(spoken(expected.difference))}\n{verdict(expected)}\np "
        )


def test_published_scores_stand_beside_ours(some: Outcomes) -> None:
    rows = {(row[0], row[1]): row[2:] for row in cells(study_pages.published(some))}
    assert len(rows) == 2 * len(ROBOTS)
    assert rows["Hopper", "PPO"][:2] == list(PUBLISHED["ppo"]["Hopper"])
    gaussian = some.finished["standard-hopper-ppo-gaussian"]
    assert rows["Hopper", "PPO"][2].startswith(f"{analysis.scores(gaussian, 'final').mean():.0f} [")
    assert rows["Ant", "TRPO"][2:] == ["missing", "missing"]
    head = study_pages.published(some).html.partition("<thead>")[2].partition("</thead>")[0]
    assert all(f" {version}, " in head or f" {version}<" in head for version in ("v2", "v3", "v5"))
    assert (
        "largest mean over ten runs" in study_pages.published(some).html
    )  # not the mean of the runs' largest


def test_published_scores_are_largest_points_of_mean_curves() -> None:
    """Two evaluations of the ten PPO runs that Tianshou publishes (test_rew_10seeds.csv of its benchmark)."""
    runs = {
        "HalfCheetah": [
            2896.34,
            8078.84,
            6583.48,
            5860.56,
            5152.05,
            5356.79,
            5456.82,
            5864.34,
            6355.09,
            6234.61,
        ],
        "Swimmer": [32.80, 33.56, 360.76, 41.67, 4.71, 36.94, 46.48, 57.04, 40.67, 12.21],
    }
    for robot, scores in runs.items():
        assert PUBLISHED["ppo"][robot][0] == f"{np.mean(scores):.1f} ± {np.std(scores):.1f}"


def test_a_ledger_row_holds_claim_verdict_numbers_and_command(some: Outcomes) -> None:
    found = [judge(some, claim) for claim in CHEAP]
    rows = cells(study_pages.ledger(found))
    assert [row[1].partition("\n")[0] for row in rows] == [quotes.verdict(each).upper() for each in found]
    assert rows[-1][1].startswith("NOT TESTED\nJudged anew: ")
    (wins,) = [
        row for row in rows if row[0].endswith("\n<code>inbounds study ledger wins-ppo-standard</code>")
    ]
    assert wins[0].startswith("“In the four environments both in PPO and TRPO")
    _, _, behind, _, hopper, ant, missing = wins[1].split("\n")
    assert behind == "cells: 4 of 12; listed in the protocol"
    assert hopper.startswith("Hopper: ")
    assert ant.startswith("Ant: ")
    assert missing == "missing: HalfCheetah, Swimmer, Walker2d, Humanoid"
    thesis, own = quotes.thesis_and_book(found)
    for whose, part in (("The thesis's claims", thesis), ("This book's own", own)):
        assert (
            f"{whose}: {ledger_table.counted(part)}".replace("'", "&#39;") in study_pages.ledger(found).html
        )
    assert "1 refuted, 1 undecided, 1 not tested" in ledger_table.counted(thesis)
    assert ledger_table.counted(found[:1]).startswith("1 claim: ")
    assert "<p>Refuted:</p>" in study_pages.decided(found).html


def test_the_caption_says_what_a_time_is_repeated_over_where_a_row_has_one(nothing: Outcomes) -> None:
    (timed,) = claims_named([ledger_table.TIMED])
    assert computed._REPEATS == 10
    row = Finding(timed, (), 0, 0)
    assert "intervals over seeds, of fisher-time over ten repeats;" in study_pages.ledger([row]).html
    assert "intervals over seeds;" in study_pages.ledger([]).html


def test_the_middle_seed_is_in_the_middle(some: Outcomes) -> None:
    outcome = some.finished["standard-hopper-ppo-beta"]
    returns = outcome.ways["median"]
    middle = returns[study_pages.middle_seed(outcome)]
    assert np.sum(returns < middle) == 4
    assert np.sum(returns > middle) == 5


def test_the_middle_seed_is_one_whose_policy_is_kept(some: Outcomes) -> None:
    outcome = some.finished["standard-hopper-ppo-beta"]
    three = dataclasses.replace(outcome.cell, keeps_seeds=outcome.cell.seeds[:3])
    assert study_pages.middle_seed(dataclasses.replace(outcome, cell=three)) in range(3)


def test_films_that_cannot_be_shown_are_called_missing(nothing: Outcomes) -> None:
    shown = study_pages.films(nothing, "Hopper")
    assert "missing, not finished: Gaussian, clipped, Beta, Logit-normal" in shown.html
    assert repr(shown) == "<films: Hopper, PPO, one per family>"


def test_without_the_source_tree_the_message_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="clone the project"):
        study_pages.shipped(tmp_path)


def test_a_share_at_a_clamp_counts_each_parameter_once() -> None:
    at = {"at_alpha_max": np.full((2, 3), 0.5), "at_beta_max": np.full((2, 3), 1.0), "kl": np.ones((2, 3))}
    np.testing.assert_array_equal(arms._share_at_a_clamp(at), 0.75)
    ends = {"at_log_std_min": np.full((2, 3), 0.25), "at_log_std_max": np.full((2, 3), 0.5)}
    np.testing.assert_array_equal(arms._share_at_a_clamp(ends), 0.75)
