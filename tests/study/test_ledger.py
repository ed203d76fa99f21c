"""The ledger's verdicts follow from its numbers, its numbers from the files: recomputed here by other code."""

import itertools
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inbounds.cli.studying import study
from inbounds.study import StudyFolder, select, study_cells
from inbounds.study import statistics as study_statistics
from inbounds.study.analysis import CONTRASTS
from inbounds.study.grid import ROBOTS, Cell
from inbounds.study.ledger import (
    CLAIMS,
    Claim,
    Finding,
    Statement,
    claims_named,
    count,
    evidence,
    judge,
    possible_verdicts,
    quotes,
)
from inbounds.study.ledger.evidence import MARGIN, costs, equals, side
from inbounds.study.ledger.half_of_a_gap import half_left
from inbounds.study.ledger.shared_names import squash
from inbounds.study.ledger.verdicts import STATES, State
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import Comparison, Estimate
from tests.study.small import folder_in
from tests.study.synthetic import write_cells

ROOT = Path(__file__).parents[2]
SHIPPED = StudyFolder(ROOT / "results", ROOT / "runs" / "study")
FROM_CELLS = [claim for claim in CLAIMS if claim.cells]


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    """The whole study, never run."""
    folder = folder_in(tmp_path_factory.mktemp("whole"))
    write_cells(folder, study_cells())
    return Outcomes.read(folder)


@pytest.fixture(scope="module")
def judged(made_up: Outcomes) -> dict[str, Finding]:
    """What the whole study says, by claim."""
    return {claim.id: judge(made_up, claim) for claim in FROM_CELLS}


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    """PPO's cells of two arms, and one mechanism on Hopper: seconds less than the whole study."""
    folder = folder_in(tmp_path_factory.mktemp("few"))
    arms = [cell for cell in study_cells() if cell.arm in ("standard", "beyond") and cell.algorithm == "ppo"]
    entropy = [cell for cell in study_cells() if cell.id == "mechanisms-hopper-ppo-beta-entropy-0"]
    write_cells(folder, arms + entropy)
    return Outcomes.read(folder)


@pytest.fixture(scope="module")
def shipped() -> Outcomes:
    return Outcomes.read(SHIPPED)


# ---- the rule


@given(st.lists(st.sampled_from(STATES), min_size=1, max_size=8), st.none() | st.integers(1, 8), st.data())
@settings(deadline=None, max_examples=150)
def test_what_arrives_later_changes_no_decided_verdict(
    states: list[State], needed: int | None, data: st.DataObject
) -> None:
    if needed is not None:
        needed = min(needed, len(states))
    before = count(states, needed)
    later = [data.draw(st.sampled_from(STATES[:4])) if state == "missing" else state for state in states]
    if before != "undecided":
        assert count(later, needed) == before


@pytest.mark.parametrize("length", [1, 2, 3])
def test_what_arrives_later_changes_nothing_of_the_small_cases(length: int) -> None:
    """All of them: chance may miss the one that matters."""
    for states in itertools.product(STATES, repeat=length):
        fills = [STATES[:4] if state == "missing" else (state,) for state in states]
        for needed in (None, *range(1, length + 1)):
            before = count(states, needed)
            for later in itertools.product(*fills):
                assert before in ("undecided", count(later, needed)), (states, needed, later)


@given(st.lists(st.sampled_from(STATES[:2]), min_size=1, max_size=8), st.integers(1, 8))
@settings(deadline=None, max_examples=50)
def test_where_all_is_known_counting_decides(states: list[State], needed: int) -> None:
    needed = min(needed, len(states))
    assert count(states, needed) == ("supported" if states.count("for") >= needed else "refuted")
    assert count(states) == ("refuted" if "against" in states else "supported")


def test_where_there_is_nothing_to_explain_nothing_is_decided() -> None:
    assert count(["moot", "moot"]) == count(["missing"]) == count(["open"]) == "undecided"
    assert count(["moot", "for"]) == "supported"
    assert count(["moot", "against", "missing"]) == "refuted"


ENDS = {"above": (1.0, 2.0), "across": (-1.0, 1.0), "below": (-2.0, -1.0)}


def of_six(rows: list[tuple[str, float]], gone: set[int], below: set[int]) -> list[Statement]:
    """Statements on six robots from where an interval lies and its raw p-value."""
    p_values = [np.nan if i in gone else p for i, (_, p) in enumerate(rows)]
    compared = {
        robot: Comparison(None if i in gone else estimate(*ENDS[rows[i][0]]), p_values[i], float(p))
        for i, (robot, p) in enumerate(zip(ROBOTS, study_statistics.holm(p_values), strict=True))
    }
    ahead = [robot for i, robot in enumerate(ROBOTS) if i not in below]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "_compared", lambda *_: compared)
        found = evidence.beats(CONTRASTS[0], robots=ahead, below=[r for r in ROBOTS if r not in ahead])
        return list(found(Outcomes({}, {}, SHIPPED)))


@given(
    st.lists(
        st.tuples(st.sampled_from(list(ENDS)), st.sampled_from([1e-4, 0.004, 0.009, 0.015, 0.03, 0.2])),
        min_size=6,
        max_size=6,
    ),
    st.sets(st.integers(0, 5)),
    st.sets(st.integers(0, 5)),
    st.none() | st.integers(1, 6),
)
@settings(deadline=None, max_examples=300)
def test_the_outlook_keeps_its_word(
    rows: list[tuple[str, float]], gone: set[int], below: set[int], needed: int | None
) -> None:
    """What cells make of a claim was not out of reach before; when all are there, nothing is left open to them."""
    part, whole = of_six(rows, gone, below), of_six(rows, set(), below)
    for before, after in zip(part, whole, strict=True):
        assert after.state in before.reachable
        assert after.reachable == (after.state,)
    verdict = count([each.state for each in whole], needed)
    assert verdict in possible_verdicts([each.reachable for each in part], needed)
    assert possible_verdicts([each.reachable for each in whole], needed) == {verdict}


def test_what_holm_leaves_open_may_be_found_where_its_p_can_fall_below_the_level() -> None:
    def first(p: float, gone: set[int]) -> Statement:
        return of_six([("above", p), *[("across", 0.9)] * 5], gone, set())[0]

    assert (first(0.009, {4, 5}).state, first(0.009, {4, 5}).may_become) == ("open", ("for",))
    assert str(first(0.009, {4, 5})).endswith("(open, not after Holm)")
    assert first(0.009, set()).may_become == ()
    assert first(0.02, {4, 5}).may_become == (), "times four, at best"
    assert first(0.004, {4, 5}).state == "for"


def test_the_outlook_in_words() -> None:
    def outlook(*statements: Statement, needed: int | None = None) -> str:
        return Finding(replace(FROM_CELLS[0], needed=needed), statements, 0, 0).outlook

    found, lost = (
        Statement("a", "for", estimate(1, 2), 0.01),
        Statement("b", "against", estimate(-2, -1), 0.01),
    )
    wide, absent = Statement("c", "open", estimate(-1, 1), 0.9), Statement("d", "missing")
    by_holm = Statement("e", "open", estimate(1, 2), 0.06, may_become=("for",))
    assert outlook(absent, absent) == outlook(found, absent) == ""
    assert outlook(found) == outlook(lost) == "", "decided"
    assert outlook(wide, absent) == "can no longer be supported"
    assert outlook(found, absent, absent, needed=2) == ""
    assert outlook(found, wide, absent, needed=2) == "can no longer be refuted"
    assert outlook(found, wide, wide, absent, needed=3) == "stays undecided"
    assert outlook(wide, found) == "stays undecided"
    assert outlook(by_holm, found) == "can no longer be refuted"
    assert Finding(claims_named(["fisher-time"])[0], (wide,), 0, 0).outlook == "", "measured anew each time"


def estimate(low: float, high: float) -> Estimate:
    return Estimate(*map(np.asarray, ((low + high) / 2, low, high)), 10, 0, 0.95, "mean")


@pytest.mark.parametrize(
    ("ends", "sign", "edge", "said"),
    [
        ((1, 2), 1, 0, "for"),
        ((-2, -1), 1, 0, "against"),
        ((-1, 1), 1, 0, "open"),
        ((1, 2), -1, 0, "against"),
        ((-2, -1), -1, 0, "for"),
        ((1, 2), 1, 3, "against"),
        ((0, 1), 1, 0, "open"),
    ],
)
def test_sides(ends: tuple[float, float], sign: int, edge: float, said: str) -> None:
    assert side(estimate(*ends), sign, edge) == said


# ---- the numbers


def test_a_combination_of_two_groups_is_their_difference() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(3, 1, 10), rng.normal(1, 4, 9)
    ours = study_statistics.combination([a, b], [1, -1])
    theirs = study_statistics.minus(a, b)
    assert (ours.value, ours.low, ours.high, ours.n) == (theirs.value, theirs.low, theirs.high, theirs.n)


def test_a_weight_scales_a_group() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(3, 1, 10), rng.normal(1, 4, 9)
    ours = study_statistics.combination([a, b], [1, -3])
    rng = np.random.default_rng(0)
    resamples = study_statistics.settings.MANY_RESAMPLES
    theirs = study_statistics.difference(a, 3 * b, rng, statistic="mean", resamples=resamples)
    np.testing.assert_allclose([ours.value, ours.low, ours.high], [theirs.value, theirs.low, theirs.high])


def test_a_combination_covers_what_it_estimates() -> None:
    """Half of a gap, four groups of ten: the interval is near that of the Normal law, whose width is known."""
    rng = np.random.default_rng(2)
    groups = [rng.normal(mean, 2, 10) for mean in (5, 1, 4, 2)]
    found = study_statistics.combination(groups, [1, -1, -0.5, 0.5])
    exact = groups[0].mean() - groups[1].mean() - (groups[2].mean() - groups[3].mean()) / 2
    error = np.sqrt(sum(w**2 * g.var(ddof=1) / 10 for w, g in zip((1, 1, 0.5, 0.5), groups, strict=True)))
    assert found.value == pytest.approx(exact)
    assert (found.high - found.low) / 2 == pytest.approx(stats.t.ppf(0.975, 30) * error, rel=0.1)


def rows(cell_id: str, folder: Path = SHIPPED.results) -> Mapping[str, Any]:
    """Columns of a cell's file as `[S, E]`, read without the study's code."""
    table = pq.read_table(folder / "cells" / f"{cell_id}.parquet")
    seeds = len(set(table["seed"].to_pylist()))
    return {
        name: table[name].to_numpy(zero_copy_only=False).reshape(-1, seeds).T for name in table.column_names
    }


def by_hand(cell_id: str, endpoint: str) -> np.ndarray:
    returns = rows(cell_id)["return_mean"]
    assert np.isfinite(returns).all(), "no seed of these cells has diverged"
    return {"start": returns[:, 0], "final": returns[:, -50:].mean(1), "area": returns.mean(1)}[endpoint]


def gap(first: str, second: str, endpoint: str) -> tuple[float, float]:
    """Difference of means, and half the width of Welch's interval."""
    a, b = by_hand(first, endpoint), by_hand(second, endpoint)
    interval = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    return a.mean() - b.mean(), (interval.high - interval.low) / 2


BEATS = re.compile(r"(\w+), (\w+), ([\w-]+) − ([\w-]+)(?: \(margin ±(\d+)\))?$")


def test_every_difference_in_the_ledger_is_that_of_the_files(shipped: Outcomes) -> None:
    """Each statement of two families with a number, against SciPy on the raw rows: value, width, test, state."""
    seen = 0
    for claim in FROM_CELLS:
        arm, endpoint = claim.cells[0].split("-")[0], endpoint_of(claim)
        for statement in judge(shipped, claim).statements:
            match = BEATS.match(statement.about)
            if statement.estimate is None or match is None or np.isnan(statement.p_adjusted):
                continue
            robot, algorithm, first, second, _ = match.groups()
            names = [f"{arm}-{robot.lower()}-{algorithm.lower()}-{family}" for family in (first, second)]
            value, half = gap(*names, endpoint)
            assert statement.estimate.value == pytest.approx(value)
            assert (statement.estimate.high - statement.estimate.low) / 2 == pytest.approx(half, rel=0.2)
            p = stats.ttest_ind(*(by_hand(name, endpoint) for name in names), equal_var=False).pvalue
            if statement.state in ("for", "against"):
                assert p < 0.05
            assert statement.p_adjusted >= 1e-4
            seen += 1
    compared = sum(
        {f"standard-{robot.lower()}-ppo-{family}" for family in ("gaussian", "logit-normal")}
        <= shipped.finished.keys()
        for robot in ROBOTS
    )
    assert seen >= 2 * compared > 0  # the start and the end, at least


def endpoint_of(claim: Claim) -> str:
    if claim.id.startswith("start"):
        return "start"
    return "area" if claim.id == "faster" else "final"


def test_the_other_numbers_are_those_of_the_files(shipped: Outcomes) -> None:
    """Changes of the fourth arm, rises and levels, where there are any; every number without a test is looked at."""
    for claim in FROM_CELLS:
        for statement in judge(shipped, claim).statements:
            if statement.estimate is None or not np.isnan(statement.p_adjusted):
                continue
            value = float(statement.estimate.value)
            parts = statement.about.partition(" (")[0].split(", ")
            if claim.id in ("start-raw", "beta-entropy", "clip", "swimmer-gamma"):
                robot, algorithm, family, variant = (part.lower() for part in parts)
                changed = f"mechanisms-{robot}-{algorithm}-{family}-{variant}"
                arm = "beyond" if (algorithm, family) == ("trpo", "beta") else "standard"
                plain = f"{arm}-{robot}-{algorithm}-{family}"
                assert value == pytest.approx(gap(changed, plain, endpoint_of(claim))[0])
            elif claim.id == "beta-trpo":
                cell = f"beyond-{parts[0].lower()}-trpo-beta"
                assert value == pytest.approx(np.mean(by_hand(cell, "final") - by_hand(cell, "start")))
            elif claim.id.startswith("large"):
                robot, algorithm, family = (part.lower() for part in parts)
                found = rows(f"printed-{robot}-{algorithm}-{family}")
                names = ["abs_loc_q99"] if family == "logit-normal" else ["at_alpha_max", "at_beta_max"]
                last = sum(found[name][:, [459, 469, 479, 489, 499]].mean() for name in names)
                assert value == pytest.approx(last, rel=1e-5)
            elif claim.id in ("start-noise", "cause-noise", "cause-capg"):
                robot = statement.about.removesuffix(" (gap)").lower()
                arm, ending = ("beyond", "") if claim.id == "cause-capg" else ("mechanisms", "-matched-noise")
                now = f"{arm}-{robot}-ppo-" + ("clipped-gaussian" if not ending else f"logit-normal{ending}")
                than = (
                    f"standard-{robot}-ppo-gaussian" if not ending else f"{arm}-{robot}-ppo-gaussian{ending}"
                )
                before = gap(
                    f"standard-{robot}-ppo-logit-normal", f"standard-{robot}-ppo-gaussian", endpoint_of(claim)
                )[0]
                if statement.state == "moot":
                    assert value == pytest.approx(before)
                else:
                    assert value == pytest.approx(gap(now, than, endpoint_of(claim))[0] - before / 2)
            elif claim.id == "swimmer-order":
                algorithm, pair = parts[0].lower(), parts[1].split(" − ")
                names = [f"mechanisms-swimmer-{algorithm}-{family}-gamma-0.9999" for family in pair]
                assert value == pytest.approx(gap(names[0], names[1], "final")[0])
            elif claim.id.startswith("overall"):
                arm, algorithm = claim.id.partition("-")[2], parts[0].lower()
                wins = []
                for robot in ROBOTS:
                    a, b = (
                        by_hand(f"{arm}-{robot.lower()}-{algorithm}-{f}", "final")
                        for f in ("logit-normal", "gaussian")
                    )
                    wins.append(stats.mannwhitneyu(a, b).statistic / (len(a) * len(b)))
                assert value == pytest.approx(np.mean(wins))
            else:
                assert claim.id == "ties", f"{claim.id}: say here how its number follows from the files"


def test_numbers_do_not_depend_on_the_order_in_which_they_are_asked_for(shipped: Outcomes) -> None:
    claim = claims_named(["wins-ppo-standard"])[0]
    first = judge(shipped, claim)
    for other in FROM_CELLS[::-1]:
        judge(shipped, other)
    assert judge(shipped, claim).told == first.told


# ---- the whole study


@pytest.mark.slow
def test_a_whole_study_leaves_nothing_missing(judged: dict[str, Finding]) -> None:
    for name, found in judged.items():
        assert found.finished == found.planned > 0, name
        assert all(statement.state != "missing" for statement in found.statements), name
        assert all(statement.estimate is not None for statement in found.statements)
        assert found.verdict != "undecided" or found.outlook == "stays undecided", name
    verdicts = {name: found.verdict for name, found in judged.items()}
    # What the made-up levels say: Beta above Gaussian by 250, logit-normal above Beta by 250, everywhere.
    assert (
        verdicts["wins-ppo-printed"]
        == verdicts["wins-beta-standard"]
        == verdicts["overall-printed"]
        == "supported"
    )
    assert verdicts["trpo-named"] == verdicts["swimmer-standard"] == verdicts["beta-trpo"] == "refuted"
    assert verdicts["ties"] == "refuted"
    assert verdicts["start-printed"] == "undecided"  # nothing differs there
    # A variant costs 20 for each letter of its name: clear losses, which hardly exceed the margins of 150 and 210.
    assert verdicts["swimmer-gamma"] == "refuted"
    assert verdicts["clip"] == "undecided"


def test_a_statement_names_the_cells_it_needs(made_up: Outcomes) -> None:
    """Without the first or the last of its cells a claim has something missing, or there is nothing to explain."""
    moot = set()
    for claim in FROM_CELLS:
        chosen = select(claim.cells)
        for cell in {chosen[0], chosen[-1]}:
            less = Outcomes(
                {k: v for k, v in made_up.finished.items() if k != cell.id}, made_up.states, made_up.folder
            )
            states = {s.state for s in judge(less, claim).statements}
            if states == {"moot"}:
                moot.add(claim.id)
            else:
                assert "missing" in states, f"{claim.id} does without {cell.id}"
    assert moot == {"start-noise"}, "the made-up study starts without gaps"


@pytest.mark.parametrize("seed", range(4))
def test_the_whole_study_decides_within_what_a_part_of_it_leaves_open(
    made_up: Outcomes, judged: dict[str, Finding], seed: int
) -> None:
    """Without some of the cells a claim says what is out of reach; with all of them it keeps its word."""
    rng = np.random.default_rng(seed)
    kept = {name: cell for name, cell in made_up.finished.items() if rng.random() < 0.6}
    part = Outcomes(kept, made_up.states, made_up.folder)
    for claim in FROM_CELLS:
        before, after = judge(part, claim), judged[claim.id].verdict
        if before.verdict != "undecided":
            assert after == before.verdict, claim.id
        else:
            assert before.outlook != f"can no longer be {after}", claim.id
            assert before.outlook != "stays undecided" or after == "undecided", claim.id


# ---- what needs no cell


@pytest.mark.slow
def test_what_is_computed_on_the_spot_is_decided(shipped: Outcomes) -> None:
    """Mathematics and untrained policies: of cost alone the machine may have a say."""
    verdicts = {claim.id: judge(shipped, claim).verdict for claim in CLAIMS if not claim.cells}
    del verdicts["fisher-time"]
    assert verdicts == {
        "start-cause": "refuted",
        "start-cause-drawn": "supported",
        "kl": "supported",
        "fisher-error": "supported",
        "beta-hessian": "refuted",
        "centres": "refuted",
    }


def test_half_of_a_gap() -> None:
    rng = np.random.default_rng(0)
    low, middle, high = (rng.normal(mean, 1, 10) for mean in (0.0, 5.0, 10.0))
    kept = half_left("x", [high, low], [high, low], claimed=True)
    closed = half_left("x", [middle, middle], [high, low], claimed=True)
    assert (kept.state, closed.state) == ("for", "against")
    assert half_left("x", [middle, middle], [high, low], claimed=False).state == "for"
    assert closed.estimate is not None
    assert closed.estimate.value == pytest.approx(-(high.mean() - low.mean()) / 2)


@pytest.mark.parametrize("there", [True, False])
def test_a_gap_that_is_not_clear_is_moot_whatever_is_left_of_it(there: bool) -> None:
    """And tells itself: it is known before the cells are run that would say how much is left."""
    rng = np.random.default_rng(0)
    low, high = (rng.normal(mean, 1, 10) for mean in (0.0, 10.0))
    now = [high, low] if there else None
    for before in ([low, low], [low + 0.05, low], [low, high]):
        found = half_left("x", now, before, claimed=True)
        assert (found.state, found.about, found.reachable) == ("moot", "x (gap)", ("moot",))
        assert found.estimate is not None
        assert found.estimate.value == pytest.approx(before[0].mean() - before[1].mean())
    assert half_left("x", None, [high, low], claimed=True).state == "missing"
    assert half_left("x", now, None, claimed=True).state == "missing"


def test_a_group_in_both_gaps_is_drawn_once(few: Outcomes) -> None:
    """CAPG's gain over the Gaussian, and half of the logit-normal's gain over the same Gaussian: three groups."""
    (claim,) = claims_named(["cause-capg"])
    for statement in judge(few, claim).statements:
        robot = statement.about.lower()
        names = [
            f"{arm}-{robot}-ppo-{family}"
            for arm, family in (
                ("beyond", "clipped-gaussian"),
                ("standard", "gaussian"),
                ("standard", "logit-normal"),
            )
        ]
        final = [few.finished[name].returns[:, -50:].mean(1) for name in names]
        variance = sum(w**2 * x.var(ddof=1) / len(x) for w, x in zip((1, 0.5, 0.5), final, strict=True))
        assert statement.estimate is not None
        width = float(statement.estimate.high - statement.estimate.low)
        # Drawn twice, the middle group would count with 1 + ¼ in place of ¼.
        assert width / np.sqrt(variance) == pytest.approx(2 * stats.t.ppf(0.975, 25), rel=0.12)


def test_what_the_protocol_does_not_list_is_called_exploratory(judged: dict[str, Finding]) -> None:
    """Listed: differences with the protocol's test, the probability of improvement, changes on one robot."""
    for claim in FROM_CELLS:
        statements = judged[claim.id].statements
        tested = all(not np.isnan(s.p_adjusted) for s in statements) and not claim.id.startswith("start")
        listed = tested or claim.id.startswith("overall") or claim.id == "swimmer-gamma"
        assert claim.standing == ("listed in the protocol" if listed else "exploratory"), claim.id
    assert claims_named(["kl"])[0].standing == "computed, no cell of the study"


@given(st.lists(st.floats(0, 1), min_size=6, max_size=6), st.sets(st.integers(0, 5)))
@settings(deadline=None, max_examples=100)
def test_a_robot_that_arrives_raises_no_corrected_p(p_values: list[float], gone: set[int]) -> None:
    before = np.array([np.nan if i in gone else p for i, p in enumerate(p_values)])
    early, late = study_statistics.holm(before), study_statistics.holm(p_values)
    assert all(late[i] <= early[i] for i in range(6) if i not in gone)


class Asked(dict[str, Outcome]):
    """No finished cell: it notes which are asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[str] = set()

    def get(self, name: str, default: Any = None) -> Any:
        self.names.add(name)
        return default


@pytest.mark.parametrize("claim", FROM_CELLS, ids=lambda claim: claim.id)
def test_a_claim_looks_at_the_columns_it_names(claim: Claim) -> None:
    """And, where its words name algorithms, at those: on all robots, which Holm's correction is over."""
    asked = Asked()
    claim.evidence(Outcomes(asked, {}, SHIPPED))
    looked, named = (
        {(cell.arm, cell.algorithm, cell.family, cell.variant) for cell in select(names)}
        for names in (tuple(asked.names), claim.cells)
    )
    assert asked.names
    assert looked <= named
    said = set(re.findall("TRPO|PPO", claim.says))
    assert not said or said == {algorithm.upper() for _, algorithm, *_ in named}


def outcome_of(cell: Cell, **known: Any) -> Outcome:
    empty, seeds = np.empty((0, 0)), len(cell.seeds)
    nothing = Outcome(cell, np.empty(0), empty, empty, np.zeros(seeds, np.bool_), {}, {}, {}, empty, {})
    return replace(nothing, **known)


def test_a_cell_of_which_one_seed_has_a_first_return_is_missing() -> None:
    (claim,) = claims_named(["start-standard"])
    rng = np.random.default_rng(0)
    finished = {
        cell.id: outcome_of(cell, returns=rng.normal(size=(10, 50)))
        for cell in select(claim.cells)
        if cell.robot in ("Hopper", "Ant")
    }
    finished["standard-hopper-ppo-gaussian"].returns[1:] = np.nan
    statements = judge(Outcomes(finished, {}, SHIPPED), claim).statements
    there = [statement.about for statement in statements if statement.state != "missing"]
    assert there == ["Ant, PPO, logit-normal − gaussian"]


# ---- margins


@pytest.mark.parametrize(
    ("name", "measured", "state"),
    [
        ("large-beta", {"at_alpha_max": 0.016, "at_beta_max": 0.005}, "for"),  # 1.05 % of both together
        ("large-beta", {"at_alpha_max": 0.015, "at_beta_max": 0.004}, "against"),
        ("large-logit-normal", {"abs_loc_q99": np.log(0.9901 / 0.0099)}, "for"),
        ("large-logit-normal", {"abs_loc_q99": np.log(0.9899 / 0.0101)}, "against"),
    ],
)
def test_large_begins_where_the_row_says(name: str, measured: dict[str, float], state: State) -> None:
    """One per cent, by the mean of the last five measurements; what was measured before does not count."""
    (claim,) = claims_named([name])
    cell = select(claim.cells)[0]
    shape = np.linspace(0.9999, 1.0001, 10)[:, None] * (np.arange(51) >= 46)
    outcome = outcome_of(cell, measured={key: level * shape for key, level in measured.items()})
    statements = judge(Outcomes({cell.id: outcome}, {}, SHIPPED), claim).statements
    assert [statement.state for statement in statements if statement.state != "missing"] == [state]


def test_equality_needs_the_whole_interval_within_the_margin(made_up: Outcomes) -> None:
    claim = equals(squash("ppo", "standard"), ["Hopper"])
    (far,) = claim(made_up)
    edge = int(re.search(r"±(\d+)", far.about)[1])  # type: ignore[index]
    start, end = (rows_of(made_up, "standard-hopper-ppo-gaussian", k) for k in ("start", "final"))
    assert edge == pytest.approx(MARGIN * (end - start), abs=1)
    assert far.state == "against"  # 500 apart, the margin is about 140


def rows_of(outcomes: Outcomes, cell: str, endpoint: str) -> float:
    returns = outcomes.finished[cell].returns
    return float((returns[:, 0] if endpoint == "start" else returns[:, -50:].mean(1)).mean())


@pytest.mark.parametrize(
    ("ends", "needs", "serves"),
    [
        ((-200, -150), "for", "against"),  # a loss that matters
        ((-200, -20), "open", "open"),  # a loss, perhaps one that does not matter
        ((-50, -20), "against", "for"),  # a loss that does not
        ((-50, 30), "against", "for"),
        ((-200, 30), "open", "open"),
    ],
)
def test_a_loss_matters_beyond_the_margin(
    few: Outcomes, monkeypatch: pytest.MonkeyPatch, ends: tuple[int, int], needs: State, serves: State
) -> None:
    monkeypatch.setattr(evidence, "margin", lambda *_: 100.0)
    monkeypatch.setattr(evidence, "_change", lambda *_: estimate(*ends))
    for claimed, state in ((True, needs), (False, serves)):
        (found,) = costs(["mechanisms-hopper-ppo-beta-entropy-0"], claimed=claimed)(few)
        assert found.state == state


# ---- how it is told


def test_the_command_prints_the_statements(shipped: Outcomes, capsys: pytest.CaptureFixture[str]) -> None:
    where = ["--results", str(ROOT / "results")]
    assert study(["ledger", *where]) == 0
    ids = "|".join(re.escape(claim.id) for claim in CLAIMS)
    told_of_each = re.split(rf"^(?:{ids}): ", capsys.readouterr().out, flags=re.MULTILINE)[1:]
    for claim, told in zip(CLAIMS, told_of_each, strict=True):
        found = judge(shipped, claim)
        assert told.startswith(f"{quotes.verdict(found)} ({found.counted})\n")
        assert all(str(statement) in told for statement in found.statements)
        assert claim.id not in quotes.NOT_TESTED or quotes.judged_anew(found) in told


def test_the_command_names_the_cells_that_are_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_in(tmp_path)
    (claim,) = claims_named(["wins-ppo-standard"])
    missing, damaged, *finished = select(claim.cells)
    write_cells(folder, [damaged, *finished])
    with folder.cell_file(damaged).open("ab") as file:
        file.write(b"more")
    assert study(["ledger", claim.id, "--results", str(folder.results)]) == 0
    told = capsys.readouterr().out
    assert f"the others: inbounds study run {missing.id} {damaged.id}\n" in told
    assert f"  {damaged.id}: damaged, and so not used\n" in told
    assert f"{missing.id}: missing" not in told


def test_an_unknown_claim_is_a_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert study(["ledger", "nonsense", "--results", str(SHIPPED.results)]) == 2
    assert "there are start-printed" in capsys.readouterr().err


def test_claims_have_names_of_their_own_and_cells_of_the_study() -> None:
    assert len({claim.id for claim in CLAIMS}) == len(CLAIMS)
    for claim in FROM_CELLS:
        assert select(claim.cells)
        assert all(select([pattern]) for pattern in claim.cells)


def test_words() -> None:
    found = Finding(CLAIMS[0], (), 2, 12)
    assert found.cells == "2 of 12"
    assert found.counted == "needed: 0; stays undecided"
    assert found.verdict == "undecided"
