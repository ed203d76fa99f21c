"""The second study's yardsticks and verdicts; `test_independent` repeats its numbers by other means."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from inbounds import robots
from inbounds.study import StudyFolder, second
from inbounds.study.analysis import scores
from inbounds.study.grid import AFTERWARDS, ROBOTS, SECOND, all_cells, second_cells, study_cells
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.running.evaluate import play
from inbounds.study.second.pooled import is_whole, pooled_scores
from inbounds.study.second.primary import BOUNDED, PERMUTATIONS, RESAMPLES, finding
from inbounds.study.second.secondary import PAIRS, TWINS
from inbounds.study.statistics import Estimate, smallest_detectable_effect
from tests.study import synthetic
from tests.study.second import independent
from tests.study.second.test_cells import NAMES, ROWS, TEXT
from tests.study.small import folder_in
from tests.study.synthetic import write_cells
from tests.study.test_grid import differences

# Mean return of the first epoch of the first study's quiet Gaussian under PPO, executed noise 0.4.
UNTRAINED = dict(zip(ROBOTS, (-178.70, 23.19, -0.73, 6.93, 119.44, 127.01), strict=True))
HISTORY = Path(__file__).resolve().parents[3] / "results" / "HISTORY.md"


def test_the_yardsticks_are_those_of_the_protocol() -> None:
    table = TEXT.partition("| Robot | doing nothing |")[2].partition("\n\n")[0]
    for line in table.splitlines()[2:]:
        robot, *numbers = (part.strip().replace("−", "-") for part in line.strip("|").split("|"))
        assert [float(x) for x in numbers] == [
            second.DO_NOTHING[robot],
            UNTRAINED[robot],
            second.BEST["final"][robot],
            second.BEST["area"][robot],
            second.MARGINS["final"][robot],
            second.MARGINS["area"][robot],
        ]
    assert f"**{RESAMPLES:,}** resamples".replace(",", " ") in TEXT
    assert f"**{PERMUTATIONS:,}** permutations".replace(",", " ") in TEXT


def test_the_yardsticks_come_from_the_first_study() -> None:
    first = Outcomes.read(StudyFolder.shipped(), (*study_cells(), *AFTERWARDS))
    for robot in ROBOTS:
        standard = [o for o in first.finished.values() if o.cell.arm == "standard" and o.cell.robot == robot]
        assert len(standard) == 5
        for endpoint, best in second.BEST.items():
            assert best[robot] == pytest.approx(max(scores(o, endpoint).mean() for o in standard), abs=0.005)
        (quiet,) = [
            o
            for o in first.finished.values()
            if (o.cell.robot, o.cell.algorithm, o.cell.family, o.cell.variant)
            == (robot, "ppo", "gaussian", "matched-noise")
        ]
        assert UNTRAINED[robot] == pytest.approx(quiet.returns[:, 0].mean(), abs=0.005)
        for endpoint, margin in second.MARGINS.items():
            fifth = (second.BEST[endpoint][robot] - UNTRAINED[robot]) / 5
            assert margin[robot] == pytest.approx(fifth, rel=0.025)


@pytest.mark.parametrize("robot", ROBOTS)
def test_doing_nothing(robot: str) -> None:
    """Ten of the hundred episodes: their mean is near that of all, by the spread between episodes."""
    envs = robots.make(f"{robot}-v5", 10)
    still = np.zeros((10, *envs.single_action_space.shape), envs.single_action_space.dtype)
    returns, _ = play(envs, lambda obs: still, range(10))
    envs.close()
    spread = {"Swimmer": 21.0, "Hopper": 38.0, "Walker2d": 9.5, "Humanoid": 3.2}.get(robot, 5.0)
    assert returns.mean() == pytest.approx(second.DO_NOTHING[robot], abs=3.5 * spread / np.sqrt(10))


def test_what_ten_and_twenty_seeds_find() -> None:
    for n, said in ((10, "2.05"), (20, "1.33")):
        effect = smallest_detectable_effect(n, np.random.default_rng(0), tests=24, trials=100_000)
        assert effect == pytest.approx(float(said), abs=0.01)
        assert said in TEXT


def estimate(value: float, half: float) -> Estimate:
    return Estimate(np.array(value), np.array(value - half), np.array(value + half), 20, 0, 0.95, "mean")


@pytest.mark.parametrize(
    ("value", "half", "p", "word"),
    [
        (5.0, 1.0, 0.001, "confirmed"),
        (-5.0, 1.0, 0.001, "contradicted"),
        (5.0, 1.0, 0.05, "undecided"),  # p has to be below it
        (5.0, 1.0, 0.051, "undecided"),
        (0.0, 1.9, 0.9, "refuted"),
        (0.5, 1.0, 0.001, "refuted"),  # found, and too small to matter
        (0.0, 2.1, 0.9, "undecided"),  # contains 0, and does not lie within the margin
        (-1.5, 0.6, 0.9, "undecided"),
    ],
)
def test_findings(value: float, half: float, p: float, word: str) -> None:
    assert finding(estimate(value, half), p, margin=2.0) == word


def test_a_verdict_waits_for_all_twenty_seeds(tmp_path) -> None:
    folder = folder_in(tmp_path)
    ten = [c for c in SECOND["B"] if c.robot == "Hopper"]
    write_cells(folder, ten)
    outcomes = Outcomes.read(folder, second_cells())
    rows = [row for row in second.primary(outcomes) if row.robot == "Hopper"]
    assert all(row.difference.n == 10 and not row.finding and np.isnan(row.p_value) for row in rows)
    write_cells(folder, [c for c in SECOND["B, more seeds"] if c.robot == "Hopper"])
    outcomes = Outcomes.read(folder, second_cells())
    rows = second.primary(outcomes)
    here = [row for row in rows if row.robot == "Hopper"]
    assert all(row.difference.n == 20 and row.finding for row in here)
    assert all(row.difference is None and not row.finding for row in rows if row.robot != "Hopper")
    assert all(np.isnan(row.p_adjusted) for row in rows if row.robot != "Hopper")
    assert min(row.p_adjusted for row in here) >= 24 / (PERMUTATIONS + 1) * 0.99  # all 24 keep their place
    column = Column("equal", "ppo", "beta")
    assert pooled_scores(outcomes, column, "Hopper", "final").shape == (20,)
    assert is_whole(outcomes, column, "Hopper")
    only_ten = Outcomes.read(folder, ten)  # the plan has twenty, whatever was read
    assert not is_whole(only_ten, column, "Hopper")
    assert not any(row.finding for row in second.primary(only_ten))
    assert not is_whole(outcomes, column, "Ant")
    assert is_whole(
        outcomes, Column("equal", "ppo", "logit-normal", "free-std"), "Hopper"
    )  # ten were planned


def test_history_names_the_rows_that_hang_on_the_reading_of_a_line() -> None:
    """An interval that contains 0 and lies within the margin: refuted, as defined; undecided, were the line a rule."""
    told = re.split("^## ", HISTORY.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (entry,) = [part for part in told if part.startswith("2026-11-28: two lines of PROTOCOL-2.md")]
    words = {
        "logit-normal": "the logit-normal's",
        "beta": "the Beta's",
        "final": "final return",
        "area": "area",
    }
    rows = second.primary(Outcomes.read(StudyFolder.shipped(), second_cells()))
    assert {row.finding for row in rows} == {
        "confirmed",
        "contradicted",
        "refuted",
        "undecided",
    }  # all are there
    named = [
        f"- {words[row.law]} {words[row.endpoint]} on {row.robot}"
        for row in rows
        if row.finding == "refuted" and row.difference.low <= 0 <= row.difference.high
    ]
    assert [line.rstrip(";.") for line in entry.splitlines() if line.startswith("- ")] == named


def test_history_has_the_spread_that_asked_for_twenty_seeds() -> None:
    spread: dict[str, list[float]] = {robot: [] for robot in ROBOTS}
    first = Outcomes.read(StudyFolder.shipped(), study_cells())
    for outcome in first.finished.values():
        cell = outcome.cell
        if cell.algorithm == "ppo" and (cell.arm, cell.variant) in (
            ("standard", ""),
            ("mechanisms", "matched-noise"),
        ):
            adds = second.BEST["final"][cell.robot] - UNTRAINED[cell.robot]
            spread[cell.robot].append(float(scores(outcome, "final").std(ddof=1)) / adds)
    single = [share for each in spread.values() for share in each]
    of_robots = {robot: np.sqrt(np.mean(np.square(each))) for robot, each in spread.items()}
    lowest, highest = min(of_robots, key=of_robots.get), max(of_robots, key=of_robots.get)
    text = " ".join(HISTORY.read_text(encoding="utf-8").split())
    assert (
        f"from the {len(single)} cells it names, the root mean square of a robot's cells is "
        f"{of_robots[lowest]:.2f} ({lowest}) to {of_robots[highest]:.2f} ({highest})"
    ) in text
    assert f"Single cells go from {min(single):.2f} (the Gaussian on Humanoid) to {max(single):.2f}" in text


def test_a_secondary_test_waits_for_its_seeds_too(tmp_path) -> None:
    """With ten seeds: whole where ten were planned; estimates alone where a side has twenty to come."""
    folder = folder_in(tmp_path)
    write_cells(folder, [c for c in SECOND["B"] if c.robot == "Hopper"])
    done = Outcomes.read(folder, second_cells())
    here = [row for row in second.secondary(done) if row.comparison.difference is not None]
    assert {row.robot for row in here} == {"Hopper"}
    whole = [all(is_whole(done, c, "Hopper") for c in (row.pair.first, row.pair.second)) for row in here]
    assert not all(whole)
    for row, ready in zip(here, whole, strict=True):
        p = row.comparison.p_value, row.comparison.p_adjusted, row.p_over_everything
        assert np.isfinite(p).all() == ready
        assert np.isnan(p).all() != ready


def test_doing_nothing_scores_nought(tmp_path) -> None:
    folder = folder_in(tmp_path)
    column = Column("equal", "ppo", "beta")
    write_cells(folder, [c for c in SECOND["B"] if c.family == "beta"])
    ten = Outcomes.read(folder, second_cells())
    assert second.normalized(ten, column, "final") is None  # the other ten seeds are planned, too
    assert second.aggregate(ten, column, "final") is None
    write_cells(folder, [c for c in SECOND["B, more seeds"] if c.family == "beta"])
    found = second.normalized(Outcomes.read(folder, second_cells()), column, "final")
    raw = pooled_scores(Outcomes.read(folder, second_cells()), column, "Ant", "final")
    assert found is not None
    assert found["Ant"] == pytest.approx((raw - 994.07) / (1335.21 - 994.07))


def test_the_secondary_questions_are_those_of_the_protocol() -> None:
    table = TEXT.partition("| Question |")[2].partition("\n\n")[0]
    said = {line.split("|")[1].strip() for line in table.splitlines()[2:]}
    assert said == set(PAIRS)
    planned = {(c.arm, c.algorithm, c.family, c.variant, c.robot) for c in second_cells()}
    for pairs in PAIRS.values():
        for pair in pairs:
            for column in (pair.first, pair.second):
                assert all((*column, robot) in planned for robot in pair.robots)


def said_pairs(comparisons: str, block: str) -> Iterator[tuple[object, ...]]:
    """Read a cell of the protocol's table: both sides as (block, name, number after "at"), and the robots."""
    parts, where = re.split("[,;] ", comparisons), ROWS[block][3]
    robots = ROBOTS if where == "all six" else tuple(where.split(", "))
    numbers = [float(x) for part in parts if part.startswith("at ") for x in re.findall(r"[\d.e-]+", part)]
    for at in numbers or [None]:
        for part in parts:
            firsts, minus, second_side = part.partition(" − ")
            for first in firsts.split(" and ") if minus else ():
                sides = (name.partition(" of ")[::2] for name in (first, second_side))
                yield *((other or block, name, at) for name, other in sides), robots


def test_the_secondary_pairs_are_those_of_the_protocol() -> None:
    spoken = {law: name for name, law in NAMES.items()}
    found = {
        Column(c.arm, c.algorithm, c.family, c.variant): (b, c) for b, cells in SECOND.items() for c in cells
    }

    def named(column: Column) -> tuple[object, ...]:
        block, cell = found[column]
        config, law = cell.config, spoken[cell.family, cell.config.policy.state_dependent_std]
        if block == "E":
            return block, law, config.policy.initial_std
        return block, law, config.algorithm.learning_rate if block == "F" else None

    table = TEXT.partition("| Question |")[2].partition("\n\n")[0]
    for line in table.splitlines()[2:]:
        question, comparisons, block = (part.strip() for part in line.strip("|").split("|"))
        planned = [(named(pair.first), named(pair.second), pair.robots) for pair in PAIRS[question]]
        assert planned == list(said_pairs(comparisons, block)), question


def test_without_those_that_diverged_the_others_are_compared(tmp_path, monkeypatch) -> None:
    module = importlib.import_module("inbounds.study.second.primary")
    monkeypatch.setattr(module, "RESAMPLES", 1000)
    monkeypatch.setattr(module, "PERMUTATIONS", 999)
    folder = folder_in(tmp_path)
    blocks = [c for block in ("B", "B, more seeds") for c in SECOND[block] if c.robot == "Hopper"]
    laws = {("gaussian", "free-std"): "gaussian", ("beta", ""): "beta"}
    cells = [c for c in blocks if (c.family, c.variant) in laws]
    write_cells(folder, cells, diverged=(3,))
    outcomes = Outcomes.read(folder, second_cells())
    for without, counts in ((False, (20, 4, 0)), (True, (18, 0, 4))):
        kept = [s for s in range(10) if not (without and s == 3)]
        last: dict[str, list[float]] = {"gaussian": [], "beta": []}
        for c in cells:
            last[laws[c.family, c.variant]] += list(outcomes.finished[c.id].returns[kept, -50:].mean(1))
        (found,) = [
            row.difference
            for row in second.primary(outcomes, without_diverged=without)
            if (row.law, row.endpoint, row.robot) == ("beta", "final", "Hopper")
        ]
        assert found is not None
        assert (found.n, found.diverged, found.missing) == counts
        assert found.value == pytest.approx(np.mean(last["beta"]) - np.mean(last["gaussian"]))


def test_engines_agree_where_two_one_sided_tests_say_so(tmp_path, monkeypatch) -> None:
    """Alike; two margins apart; apart by nearly the margin, which ten seeds cannot tell from it."""
    folder, robot = folder_in(tmp_path), "Hopper"
    twins = [(ours, theirs) for ours, theirs, where in TWINS if where == robot]
    ids = {column.cell_id(robot) for pair in twins for column in pair}
    yardstick = independent.yardsticks()[robot]
    apart = {"gaussian": 0.0, "beta": 2.0, "logit-normal": 0.9}
    monkeypatch.setattr(
        synthetic,
        "level_of",
        lambda cell: 2000 + (cell.arm == "equal") * apart[cell.family] * yardstick.margin_final,
    )
    write_cells(folder, [cell for cell in all_cells() if cell.id in ids])
    outcomes = Outcomes.read(folder, all_cells())
    found = second.engines_agree(outcomes)
    assert set(found) == {(law, robot, endpoint) for law in apart for endpoint in independent.ENDPOINTS}
    for ours, theirs in twins:
        returns = [outcomes.finished[column.cell_id(robot)].returns for column in (ours, theirs)]
        for endpoint, last, margin in (
            ("final", 50, yardstick.margin_final),
            ("area", 500, yardstick.margin_area),
        ):
            a, b = (each[:, -last:].mean(1) for each in returns)
            each = found[ours.family, robot, endpoint]
            sides = [
                stats.ttest_ind(a + shift, b, equal_var=False, alternative=way).pvalue
                for shift, way in ((margin, "greater"), (-margin, "less"))
            ]
            assert each.p_value == pytest.approx(max(sides))
            assert each.difference == pytest.approx(a.mean() - b.mean())
            assert each.equivalent == (max(sides) < 0.05) == (ours.family == "gaussian")


def test_twins_differ_by_engine_and_seeds_alone() -> None:
    by_column = {(c.arm, c.algorithm, c.family, c.variant, c.robot): c for c in all_cells()}
    for ours, theirs, robot in TWINS:
        assert differences(by_column[(*ours, robot)], by_column[(*theirs, robot)]) == {"seeds", "engine"}


def test_the_protocol_names_its_hypotheses() -> None:
    assert re.findall(r"\*\*H-([\w-]+)\*\*: the", TEXT) == ["logit-normal", "Beta"]
    assert BOUNDED == ("logit-normal", "beta")
