"""Pick your own seeds: the enumeration agrees with SciPy, JavaScript with Python, and the data with the study."""

import itertools
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright._impl._driver import compute_driver_executable
from scipy import stats

from inbounds.book import verdicts
from inbounds.book.explorer import picked_seeds as module
from inbounds.book.explorer.assets import SCRIPTS
from inbounds.book.explorer.choices import verdict
from inbounds.book.explorer.picked_seeds import Reports, pairs, picked_seeds, reports
from inbounds.book.report import as_they_come, study_pages
from inbounds.study.analysis import scores
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.store import StudyFolder
from inbounds.study.words import spoken

RNG = np.random.default_rng(3)
SIDES = [
    (RNG.normal(0, 1, 10), RNG.normal(0.5, 3, 10)),
    (RNG.exponential(900, 10), RNG.normal(2500, 80, 10)),
    (RNG.normal(5, 1, 7), RNG.normal(5, 0.1, 4)),
]
PICKED = [(3, 3), (2, 4), (4, 2), (2, 2)]


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return study_pages.shipped()


@pytest.fixture(scope="module")
def data(outcomes: Outcomes) -> dict[str, Any]:
    return json.loads(json.dumps(picked_seeds(outcomes).data))  # type: ignore[no-any-return]


def in_node(expression: str, **values: Any) -> Any:
    """The value of a JavaScript expression, in which `values` are variables."""
    code = "".join(path.read_text(encoding="utf-8") for path in SCRIPTS[module.ELEMENT])
    code += ";{" + "".join(f"const {name} = {json.dumps(value)};" for name, value in values.items())
    code += f"console.log(JSON.stringify({expression}))}}"
    node = compute_driver_executable()[0]
    done = subprocess.run([node, "-"], input=code, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(("sides", "picked"), list(zip(SIDES, PICKED, strict=False)))
def test_every_report_is_welch_s(sides: tuple[Any, Any], picked: tuple[int, int]) -> None:
    every = reports(*sides, picked)
    ways = [list(itertools.combinations(side, n)) for side, n in zip(sides, picked, strict=True)]
    assert every.value.shape == tuple(map(len, ways))
    for i, j in RNG.integers(every.value.shape, size=(40, 2)):
        a, b = ways[0][i], ways[1][j]
        test = stats.ttest_ind(a, b, equal_var=False)
        interval = test.confidence_interval(0.95)
        np.testing.assert_allclose(
            [every.low[i, j], every.value[i, j], every.high[i, j]],
            [interval.low, np.mean(a) - np.mean(b), interval.high],
        )
        assert (test.pvalue < 0.05) == (every.low[i, j] > 0 or every.high[i, j] < 0)


def test_shares_are_counted() -> None:
    every = Reports(
        np.array([[3.0, 1.0], [-1.0, -9.0]]),
        np.array([[1.0, -1.0], [-3, -12]]),
        np.array([[5.0, 3], [1, -6]]),
    )
    assert every.shares() == {
        "means": {"higher": 0.5, "lower": 0.5, "nothing": 0.0},
        "interval": {"higher": 0.25, "lower": 0.25, "nothing": 0.5},
    }
    with pytest.raises(ValueError, match="at least two"):
        reports(*SIDES[0], (1, 3))


@pytest.mark.parametrize("picked", PICKED)
def test_javascript_enumerates_as_python_does(picked: tuple[int, int]) -> None:
    for first, second in SIDES:
        every = reports(first, second, picked)
        js = in_node(
            "inbounds.seeds.reports(a, b, picked)", a=first.tolist(), b=second.tolist(), picked=picked
        )
        np.testing.assert_allclose(js["gaps"], every.value.ravel(), atol=1e-9)
        sides = (every.low > 0).astype(int) - (every.high < 0).astype(int)
        np.testing.assert_array_equal(js["found"], sides.ravel())
        for rule, shares in every.shares().items():
            assert js[rule] == pytest.approx(shares)


def test_javascript_has_welch_s_interval_and_the_book_s_words() -> None:
    cases = []
    for first, second in SIDES:
        for m, n in (*PICKED, (len(first), len(second))):
            cases.append((first[:m].tolist(), second[:n].tolist()))
    js = in_node(
        "cases.map(([a, b]) => { const gap = inbounds.seeds.welch(a, b);"
        "return { gap, verdict: inbounds.seeds.verdict(gap), spoken: inbounds.seeds.spoken(gap) }; })",
        cases=cases,
    )
    words = set()
    for (a, b), found in zip(cases, js, strict=True):
        interval = stats.ttest_ind(a, b, equal_var=False).confidence_interval(0.95)
        exact = (interval.low, np.mean(a) - np.mean(b), interval.high)
        gap = found["gap"]
        np.testing.assert_allclose([gap["low"], gap["value"], gap["high"]], exact, rtol=1e-8)
        assert found["verdict"] == verdicts.verdict(exact, unit=" points")
        assert verdicts.told(exact) == f"{found['spoken']}, {found['verdict'].partition(' (')[0]}"
        words.add(found["verdict"].partition(" (")[0])
    assert words == {"below", "no difference found"}
    assert in_node("inbounds.seeds.verdict({ low: 1, value: 2, high: 3 })") == "above"


def test_the_page_has_the_study_s_results_and_words(outcomes: Outcomes, data: dict[str, Any]) -> None:
    rows = [row for arm in ("standard", "beyond") for row in as_they_come.compared(outcomes, arm, ["final"])]
    assert len(data["rows"]) == len(rows)
    shown = {(row["robot"], row["algorithm"], *row["pair"]): row for row in data["rows"]}
    for row in rows:
        one = shown[(row.robot, *row.contrast[1:])]
        assert one["told"] == f"{spoken(row.difference)} points: {verdict(row, brief=True)}"
        for family in row.contrast[2:]:
            cell = outcomes.find(Column.within(row.contrast.arm, row.contrast.algorithm, family), row.robot)
            assert cell is not None
            values = data["results"][f"{row.robot}-{row.contrast.algorithm}-{family}"]
            np.testing.assert_allclose(values, scores(cell, "final"), atol=0.051)
    first = data["rows"][0]
    assert (first["robot"], first["algorithm"], tuple(first["pair"])) == module.FIRST


def test_it_says_what_the_chapter_says_of_three_seeds(outcomes: Outcomes) -> None:
    """The share that Predict asks for: of all reports of three, how many put the logit-normal in front."""
    sides = next(
        sides
        for row, sides in pairs(outcomes)
        if row.contrast[:] == ("standard", *module.FIRST[1:2], *module.FIRST[2])
        and row.robot == module.FIRST[0]
    )
    means = [np.array([np.mean(c) for c in itertools.combinations(side, 3)]) for side in sides]
    expected = float((means[0][:, None] > means[1]).mean())
    assert reports(*sides).shares()["means"]["higher"] == expected
    said = re.search(r'alt="([^"]+)"><figcaption>(.+)</figcaption>', picked_seeds(outcomes).static)
    assert said is not None
    alt, caption = said.groups()
    assert f"{expected:.0%}".removesuffix("%") in caption
    assert len(alt) < len(caption) / 3  # what stands beside the picture is not read twice


def test_the_caption_is_of_any_pair_and_any_number_of_seeds(
    outcomes: Outcomes, monkeypatch: pytest.MonkeyPatch
) -> None:
    row, (first, second) = next(
        (row, sides) for row, sides in pairs(outcomes) if row.contrast[2:] == ("beta", "gaussian")
    )
    monkeypatch.setattr(module, "TICKED", 2)
    monkeypatch.setattr(module, "reports", lambda *sides: reports(*sides, (2, 2)))
    for sides, whole in (
        ((first[:5], second[:5]), "all 5 seeds"),
        ((first[:5], second[:4]), "all 5 and 4 seeds"),
    ):
        said = module._static(row, sides)
        assert "ways to take 2 seeds of each family report, Beta minus Gaussian on" in said
        assert f"at that of {whole}." in said


def test_the_element_is_small_and_carries_its_scripts_only_in_a_notebook(
    outcomes: Outcomes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    shown = picked_seeds(outcomes)
    html = shown._repr_html_()
    assert len(html) < 200_000
    assert not re.search(r"\bhttps?://(?!www\.w3\.org)", re.sub(r"base64,[\w+/=]+", "", html))
    assert not re.search(r"<script(?! type=\"application/json\")", html)
    assert repr(shown) == "<study: pick your own seeds>"
    monkeypatch.delenv("INBOUNDS_BOOK_BUILD")
    live = shown._repr_html_()
    assert live.index("inbounds.numerics =") < live.index("inbounds.seeds =")


def test_without_results_the_page_says_so(tmp_path: Path) -> None:
    assert (
        "none of these cells is finished" in picked_seeds(Outcomes.read(StudyFolder(tmp_path)))._repr_html_()
    )
