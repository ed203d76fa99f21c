"""The study's explorer shows the static pages' numbers and words, for every choice, in the data and in JavaScript."""

import itertools
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright._impl._driver import compute_driver_executable

from inbounds.book.explorer import element
from inbounds.book.explorer.assets import SCRIPTS
from inbounds.book.explorer.choices import (
    Place,
    choices,
    kept_of,
    places,
    planned,
    sentence,
    verdict,
)
from inbounds.book.explorer.pooled import pooled_estimate
from inbounds.book.report import answers, as_they_come, study_pages
from inbounds.book.report.equal_start import Evidence, laws, outcomes_of_both
from inbounds.book.report.leads import leads_of
from inbounds.study import analysis
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import MARGINS
from inbounds.study.statistics import Estimate
from inbounds.study.store import StudyFolder
from inbounds.study.words import side, spoken

ALGORITHMS, ENDPOINTS = ("ppo", "trpo"), ("final", "area")


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return study_pages.shipped()


@pytest.fixture(scope="module")
def data(outcomes: Outcomes) -> dict[str, Any]:
    return json.loads(json.dumps(choices(outcomes)))  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def found(outcomes: Outcomes) -> list[Place]:
    return places(outcomes)


def said(data: dict[str, Any], key: str, pair: tuple[str, str], robots: tuple[str, ...] = ROBOTS) -> str:
    """The sentence of a pair on those of some robots that have a row."""
    there = {row["robot"] for row in data["rows"].get(key, []) if tuple(row["pair"]) == pair}
    if not there:
        return "not run yet"
    bits = sum(2**i for i, robot in enumerate(ROBOTS) if robot in there.intersection(robots))
    return data["texts"][data["sentences"][key][",".join(pair)][bits]]  # type: ignore[no-any-return]


@pytest.mark.parametrize("arm", ["standard", "beyond", "printed"])
def test_rows_and_sentences_are_the_static_page_s(outcomes: Outcomes, data: dict[str, Any], arm: str) -> None:
    start = "printed" if arm == "printed" else "standard"
    rows = as_they_come.compared(outcomes, arm)
    assert rows
    for contrast, endpoint in itertools.product({row.contrast for row in rows}, ENDPOINTS):
        these = as_they_come.of(rows, contrast=contrast, endpoint=endpoint)
        key, pair = f"{start}-{contrast.algorithm}-{endpoint}", (contrast.first, contrast.second)
        if len(these) > 1:
            assert said(data, key, pair) == as_they_come.told(these)
        shown = {row["robot"]: row for row in data["rows"][key] if tuple(row["pair"]) == pair}
        assert shown.keys() == {row.robot for row in these}
        for row in these:
            one = shown[row.robot]
            assert one["told"].startswith(f"{spoken(row.difference)}: ")
            assert one["filled"] == row.found
            ends = np.array(one["ends"]) * MARGINS[endpoint][row.robot]
            exact = [row.difference.low, row.difference.value, row.difference.high]
            np.testing.assert_allclose(ends, exact, rtol=6e-3)


def test_an_equal_start_is_told_as_on_the_static_page(outcomes: Outcomes, data: dict[str, Any]) -> None:
    rows = laws(outcomes_of_both(outcomes))
    for algorithm, endpoint, law in itertools.product(ALGORITHMS, ENDPOINTS, ("beta", "logit-normal")):
        these = answers.of(rows, algorithm=algorithm, endpoint=endpoint, law=law)
        key = f"equal-{algorithm}-{endpoint}"
        if len(these) > 1:
            assert said(data, key, (law, "gaussian")) == answers.counted(these)
        shown = {row["robot"]: row for row in data["rows"].get(key, []) if row["pair"] == [law, "gaussian"]}
        assert shown.keys() == {row.robot for row in these}
        for row in these:
            words = shown[row.robot]["told"]
            assert shown[row.robot]["filled"] == words.endswith(", found")
            assert words.startswith(f"{spoken(row.difference)}: ")
            found = {1: "above", -1: "below", 0: ""}[answers.sign(row)]
            assert words.partition(": ")[2].startswith(found or ("no difference found", "too small"))


def test_a_loud_start_is_told_as_in_the_forest_of_leads(outcomes: Outcomes, data: dict[str, Any]) -> None:
    """As `leads` has it, which the chapter shows; the curves are those of the loud cell and of the plain Gaussian."""
    known = [each for each in leads_of(outcomes_of_both(outcomes)) if each.start == "both loud"]
    assert {each.robot for each in known} == {"Ant", "HalfCheetah"}
    for each in known:
        (row,) = (
            row
            for row in data["rows"][f"loud-{each.algorithm}-{each.endpoint}"]
            if row["robot"] == each.robot
        )
        assert row["pair"] == [each.law, "gaussian"]
        assert row["told"].startswith(f"{spoken(each.difference)}: ")
        drawn = data["curves"][f"loud-{each.algorithm}"][each.robot]
        assert [one["name"] for one in drawn] == ["Gaussian", "Logit-normal, loud"]
        assert not any(one["thin"] for one in drawn)


def test_curves_are_the_cells_learning_curves(outcomes: Outcomes, data: dict[str, Any]) -> None:
    seen = 0
    for start, algorithm in itertools.product(("standard", "printed"), ALGORITHMS):
        for robot, drawn in data["curves"][f"{start}-{algorithm}"].items():
            for one in drawn:
                arm = "beyond" if start == "standard" else start  # which falls back on the first arm
                cell = outcomes.find(Column.within(arm, algorithm, one["family"]), robot)
                assert cell is not None
                band, kept = analysis.curve(cell), kept_of(len(cell.steps))
                assert band is not None
                for name in ("value", "low", "high"):
                    exact = np.asarray(getattr(band, name))[kept]
                    np.testing.assert_allclose(one[name], exact, rtol=6e-4)
                np.testing.assert_allclose(data["epochs"], cell.steps[kept] / 1e6, rtol=6e-4)
                assert one["told"] == {e: spoken(analysis.estimate(cell, e)) for e in ENDPOINTS}
                assert not one["thin"]
                seen += 1
    assert seen > 40


def test_every_row_has_the_curves_of_both_its_sides(found: list[Place], data: dict[str, Any]) -> None:
    for place in found:
        drawn = data["curves"][f"{place.start}-{place.algorithm}"][place.row.robot]
        shown = {(one["family"], one["thin"], one["told"][place.row.endpoint]) for one in drawn}
        for family, cells in zip(place.pair, place.cells, strict=True):
            assert (family, place.stands_in, spoken(pooled_estimate(cells, place.row.endpoint))) in shown
        means = [float(pooled_estimate(cells, place.row.endpoint).value) for cells in place.cells]
        assert float(place.row.difference.value) == pytest.approx(means[0] - means[1], abs=1e-6)


def test_there_is_a_sentence_for_every_set_of_robots(found: list[Place], data: dict[str, Any]) -> None:
    known: dict[tuple[str, tuple[str, str]], dict[str, Any]] = {}
    for place in found:
        known.setdefault((place.key, place.pair), {})[place.row.robot] = place.row
    for (key, pair), rows in known.items():
        for robots in itertools.chain.from_iterable(
            itertools.combinations(rows, n) for n in range(len(rows) + 1)
        ):
            assert said(data, key, pair, robots) == sentence([rows[r] for r in ROBOTS if r in robots])


def gap(low: float, high: float) -> Estimate:
    return Estimate(np.array((low + high) / 2), np.array(low), np.array(high), 10, 0, 0.95, "difference")


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((300, 900), "above, suggested"),
        ((-900, -300), "below, suggested"),
        ((-90, 90), "no difference found (effects between −90.0 and 90.0 points remain possible)"),
        ((1, 900), "no difference found, the interval ends at 0"),
    ],
)
def test_a_verdict_has_the_grade_s_words(ends: tuple[float, float], words: str) -> None:
    row = Evidence("Ant", "ppo", "beta", "final", gap(*ends), study=1)
    assert verdict(row) == words
    assert verdict(row, brief=True) == words.partition(" (")[0]


def test_a_verdict_and_its_interval_agree(found: list[Place]) -> None:
    for place in found:
        gap, words = place.row.difference, verdict(place.row)
        expected = {1: "above", -1: "below", 0: "no difference found"}[side(gap.low, gap.high)]
        assert words.startswith((expected, "no difference found, the interval", "too small")), words


def in_node(data: dict[str, Any], picks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the page's script shows for some choices."""
    code = "".join(path.read_text(encoding="utf-8") for path in SCRIPTS[element.ELEMENT])
    code += f";const data = {json.dumps(data)};"
    code += (
        f"const picks = {json.dumps(picks)};"
        "const shown = picks.map((p) => inbounds.chosen(data, "
        "{ ...p, families: new Set(p.families), robots: new Set(p.robots) }));"
        "console.log(JSON.stringify(shown));"
    )
    node = compute_driver_executable()[0]
    done = subprocess.run([node, "-"], input=code, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)  # type: ignore[no-any-return]


PICKS = [
    {
        "start": start,
        "algorithm": algorithm,
        "endpoint": endpoint,
        "families": families,
        "robots": list(robots),
    }
    for start, algorithm, endpoint in itertools.product(
        ("equal", "standard", "loud", "printed"), ALGORITHMS, ENDPOINTS
    )
    for families in (
        ["gaussian", "beta"],
        ["gaussian", "clipped-gaussian", "beta", "logit-normal"],
        ["beta"],
        [],
    )
    for robots in (ROBOTS, ("Ant", "HalfCheetah"), ("Walker2d",), ())
]


def test_javascript_shows_what_python_wrote(data: dict[str, Any]) -> None:
    for pick, shown in zip(PICKS, in_node(data, PICKS), strict=True):
        where = f"{pick['start']}-{pick['algorithm']}"
        key = f"{where}-{pick['endpoint']}"
        pairs = [p for p in planned(pick["start"], pick["algorithm"]) if set(p) <= set(pick["families"])]
        chosen = tuple(robot for robot in ROBOTS if robot in pick["robots"])
        assert [line["text"] for line in shown["said"]] == [said(data, key, pair, chosen) for pair in pairs]
        rows = [
            row for row in data["rows"].get(key, []) if row["robot"] in chosen and tuple(row["pair"]) in pairs
        ]
        drawn = [row for group in shown["forest"] for row in group["rows"]]
        assert sorted(row["told"] for row in drawn) == sorted(row["told"] for row in rows)
        assert (shown["there"], shown["planned"]) == (len(rows), len(pairs) * len(chosen))
        assert bool(shown["lacking"]) == (len(rows) < len(pairs) * len(chosen))
        planned_ones = {family for pair in planned(pick["start"], pick["algorithm"]) for family in pair}
        assert set(shown["unplanned"]) == set(pick["families"]) - planned_ones
        for robot, curves in ((panel["robot"], panel["curves"]) for panel in shown["panels"]):
            there = data["curves"][where][robot]
            assert curves == [one for one in there if one["family"] in pick["families"]]


def test_the_element_is_small_and_asks_nothing_of_the_network(outcomes: Outcomes, monkeypatch) -> None:
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    shown = element.study_explorer(outcomes)
    html = shown._repr_html_()
    assert len(html) < 400_000
    assert not re.search(r"\bhttps?://(?!www\.w3\.org)", re.sub(r"base64,[\w+/=]+", "", html))
    assert not re.search(r"<script(?! type=\"application/json\")", html)
    assert repr(shown) == "<study: to choose from, robots, algorithm, families, endpoint and start>"
    alt = re.search(r'<img [^>]*alt="([^"]+)"', html)
    assert alt
    assert "HalfCheetah: Gaussian" in alt[1]
    monkeypatch.delenv("INBOUNDS_BOOK_BUILD")
    assert "inbounds.chosen =" in shown._repr_html_()  # a live notebook has no page to load it


def test_a_page_may_choose_what_is_shown_at_first(outcomes: Outcomes) -> None:
    html = element.study_explorer(outcomes, algorithm="trpo", robots=("Ant", "HalfCheetah"))._repr_html_()
    ticked = re.findall(r'name="(\w+)" value="([\w-]+)" checked', html)
    assert [value for name, value in ticked if name == "robot"] == ["HalfCheetah", "Ant"]
    assert ("algorithm", "trpo") in ticked
    assert ("start", "standard") in ticked
    assert "Learning curves, TRPO, from the usual starts" in html
    assert "Hopper: Gaussian" not in html
    with pytest.raises(TypeError, match="no such choice: robot;"):
        element.study_explorer(outcomes, robot="Ant")


def test_without_results_the_page_says_so(tmp_path: Path) -> None:
    html = element.study_explorer(Outcomes.read(StudyFolder(tmp_path)))._repr_html_()
    assert "none of these cells is finished" in html
