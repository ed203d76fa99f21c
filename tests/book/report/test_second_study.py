"""The second study's views say what is there, wait where seeds are missing, and never call an open interval equal."""

import re

import pytest

from inbounds.book.report import by_noise, secondary_tests
from inbounds.book.report import second_study as views
from inbounds.book.report.html import together
from inbounds.study import second, words
from inbounds.study.analysis import estimate
from inbounds.study.grid import SECOND, second_cells
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.words import spoken
from tests.study.small import folder_in
from tests.study.synthetic import write_cells


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Outcomes:
    """All of B on two robots, ten seeds alone on a third."""
    folder = folder_in(tmp_path_factory.mktemp("second"))
    write_cells(folder, [c for c in SECOND["B"] if c.robot in ("Hopper", "Ant", "Swimmer")])
    write_cells(folder, [c for c in SECOND["B, more seeds"] if c.robot in ("Hopper", "Ant")])
    return Outcomes.read(folder)  # of the first study: the views read the second's


def rows_of(shown: views.Shown) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", shown.html, re.DOTALL)
    return [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL) for row in rows]


def test_nothing_is_called_missing(tmp_path) -> None:
    nothing = Outcomes.read(folder_in(tmp_path))
    for view in (
        views.primary_comparison,
        views.cells,
        views.equal_starts,
        secondary_tests.comparisons,
        views.engine_check,
    ):
        assert "missing" in view(nothing).html
    assert "0 of 108" not in views.progress(nothing).html
    assert all(f"0 of {len(cells)}" in views.progress(nothing).html for cells in SECOND.values())


def test_the_primary_table(outcomes: Outcomes) -> None:
    _, *rows = rows_of(views.primary_comparison(outcomes))
    assert len(rows) == 24
    by = {tuple(row[:3]): row for row in rows}
    assert by["Ant", "Beta", "final return"][-1] == "20"
    assert by["Ant", "Beta", "final return"][4] in ("confirmed", "contradicted", "refuted", "undecided")
    assert by["Swimmer", "Beta", "final return"][-1] == "10"
    assert by["Swimmer", "Beta", "final return"][4] == "waits for seeds"
    assert by["Walker2d", "Beta", "final return"][4] == "missing"


def test_the_primary_forest_says_what_is_filled_and_what_waits(outcomes: Outcomes) -> None:
    found = outcomes.and_of(second_cells())
    rows = [row for row in second.primary(found) if row.difference is not None]
    bars = [bar for panel in views._bars(rows).values() for bar in panel]
    by_panel = sorted(rows, key=lambda row: list(views.ENDPOINTS).index(row.endpoint))
    assert [bar.hollow for bar in bars] == [
        row.finding not in ("confirmed", "contradicted") for row in by_panel
    ]
    caption = (
        views.primary_comparison(outcomes).html.partition("<figcaption>")[2].partition("</figcaption>")[0]
    )
    assert "Filled: found" in caption
    assert caption.endswith("Seeds are still to be run: Swimmer.")
    assert "still to be run" not in views._caption([row for row in rows if row.whole])


def test_a_pair_that_differs_in_its_start_says_so() -> None:
    named = {secondary_tests._named(pair) for pair in second.PAIRS["a quiet start"]}
    assert named == {
        "PPO: Gaussian free σ, quiet start − Gaussian free σ, start at σ = 1",
        "PPO: Gaussian σ(s), quiet start − Gaussian free σ, start at σ = 1",
    }
    for pairs in second.PAIRS.values():
        for pair in pairs:
            first, _, other = secondary_tests._named(pair).partition(": ")[2].partition(" − ")
            assert first != other


def test_every_cell_is_told_with_its_greedy_return(outcomes: Outcomes) -> None:
    _, *rows = rows_of(views.cells(outcomes))
    assert len(rows) == 3 * 5 + 2 * 3
    seen = outcomes.and_of(second_cells()).finished["equal-hopper-ppo-beta"]
    (row,) = [
        r for r in rows if r[0] == "Hopper" and r[1].startswith("PPO: Beta") and r[-1].startswith("10–19")
    ]
    for number, endpoint in zip(row[2:5], ("final", "area", "greedy"), strict=True):
        assert number.startswith(
            spoken(estimate(seen, endpoint)).partition("\N{NO-BREAK SPACE}")[0].split()[0]
        )
    failed = {r[0] + r[1].removesuffix(", start failed") for r in rows if r[1].endswith("start failed")}
    checks = rows_of(views.equal_starts(outcomes))[1:]
    assert failed == {r[0] + r[1] for r in checks if r[3].endswith("failed")}


def test_the_start_that_is_not_equal_is_called_failed(outcomes: Outcomes) -> None:
    _, *rows = rows_of(views.equal_starts(outcomes))
    assert len(rows) == 3 * 5 + 2 * 3
    assert all(row[3].startswith("0.4") for row in rows)
    for row in rows:  # made-up noise is anywhere between 0 and 1
        assert row[3].endswith("failed") == (abs(float(row[2]) - 0.4) > views.TOLERANCE)
    assert any(row[3].endswith("failed") for row in rows)


def test_names_of_columns() -> None:
    names = {
        views.column_name(Column(c.arm, c.algorithm, c.family, c.variant))
        for c in second_cells()
        if c.arm in ("equal", "steps")
    }
    assert names == {
        "Gaussian free σ",
        "Gaussian σ(s)",
        "Beta",
        "Logit-normal",
        "Logit-normal free σ",
        *(
            f"{law}, step size {r}"
            for law in ("Gaussian free σ", "Beta", "Logit-normal")
            for r in ("0.0001", "0.001")
        ),
    }


def test_a_comparison_that_waits_for_seeds_has_no_verdict(outcomes: Outcomes) -> None:
    """Of the table and of the words: an interval without its test is not one that the test did not find."""
    told = secondary_tests.verdicts(outcomes, "σ free or of the state", "gaussian")
    assert " of 3 robots" in told
    assert told.endswith("seeds still to be run on 1 (Swimmer)")
    rows = rows_of(secondary_tests.comparisons(outcomes))
    assert {row[1] for row in rows if row[4:5] == ["waits for seeds"]} == {"Swimmer"}
    gap = secondary_tests.difference(outcomes, "σ free or of the state", "gaussian", "Hopper")
    assert ["PPO: Gaussian free σ − Gaussian σ(s)", "Hopper", "final return", together(spoken(gap))] in [
        r[:4] for r in rows
    ]


def test_a_finding_is_kept_where_the_wider_correction_finds_it(outcomes: Outcomes) -> None:
    rows = [row for row in second.secondary(outcomes.and_of(second_cells())) if row.endpoint == "final"]
    told = [row for row in rows if words.verdict(row.comparison) in ("higher", "lower")]
    staying = [row for row in told if row.p_over_everything < 0.05]
    assert 0 < len(staying) < len(told)
    one = told[0].question, told[0].pair.first.family
    for asked in ({(row.question, row.pair.first.family) for row in rows}, {one}):
        expected = [r for r in told if (r.question, r.pair.first.family) in asked]
        found = secondary_tests.findings(outcomes, asked)
        assert [(r.pair, r.robot) for r in found] == [(r.pair, r.robot) for r in expected]
        assert [r.p_over_everything < 0.05 for r in found] == [r in staying for r in expected]


def test_secondary_rows_are_those_whose_cells_are_there(outcomes: Outcomes) -> None:
    _, *rows = rows_of(secondary_tests.comparisons(outcomes))
    assert {row[1] for row in rows} == {"Hopper", "Ant", "Swimmer"}
    assert {row[-1] for row in rows} == {
        "law, σ of the state",
        "law, σ free",
        "σ free or of the state",
        "the bounded laws",
    }
    assert {row[4] for row in rows} <= {"higher", "lower", "unresolved", "not after Holm", "waits for seeds"}
    assert all((row[4] == "waits for seeds") == (row[5] == "") for row in rows)


def test_the_laws_by_noise(tmp_path) -> None:
    folder = folder_in(tmp_path)
    chosen = [c for c in (*SECOND["B"], *SECOND["E"]) if c.robot == "Hopper"]
    write_cells(folder, [*chosen, *(c for c in SECOND["B"] if c.robot == "Ant")])
    outcomes = Outcomes.read(folder)
    shown = by_noise.by_noise(outcomes)
    _, *rows = rows_of(shown)
    assert [row[0] for row in rows] == ["Hopper, 0.2", "Hopper, 0.4", "Hopper, 0.55", "Ant, 0.4"]
    lacking = "HalfCheetah with 0.2 and 0.4 and 0.55, Ant with 0.2 and 0.55"
    assert f"Not run, or not whole: {lacking}." in shown.html
    both = outcomes.and_of(second_cells())
    for pair in second.PAIRS["other noise"]:
        noise, law = float(pair.first.variant.removeprefix("noise-")), pair.first.family
        test = second.compared(both, pair, "final")["Hopper"]
        assert by_noise.against_gaussian(outcomes, law, noise)["Hopper"] == test
        (row,) = (row for row in rows if row[0] == f"Hopper, {noise:g}")
        assert together(spoken(test.difference)) in row[1 if law == "beta" else 2]
    column = Column("equal", "ppo", "beta")
    moved = second.pooled_difference(
        both, column._replace(arm="noise", variant="noise-0.2"), column, "Hopper", "final"
    )
    assert by_noise.change(outcomes, "beta", 0.2, "Hopper") == moved
    assert by_noise.change(outcomes, "beta", 0.2, "Ant") is None


def test_a_verdict_by_noise_is_told_in_the_pages_words(tmp_path) -> None:
    folder = folder_in(tmp_path)
    cells = [c for c in SECOND["E"] if c.robot == "Hopper" and c.variant == "noise-0.2"]
    write_cells(folder, cells)
    _, (*_, beta, logit_normal) = rows_of(by_noise.by_noise(Outcomes.read(folder)))
    for told in (beta, logit_normal):
        assert re.search(r"(above|below|no difference found)$", told)
