"""A number has one interval, whichever page prints it: what the stored notebooks glue, and where it is computed."""

import json
import re
from collections import defaultdict
from itertools import combinations
from pathlib import Path

import pytest

from inbounds.book.explorer.pooled import pooled_estimate
from inbounds.book.report import study_pages
from inbounds.book.report.as_they_come import compared
from inbounds.book.report.over_seeds import mean_of, minus
from inbounds.study import analysis, statistics
from inbounds.study.analysis import Contrast, scores

ROOT = Path(__file__).resolve().parents[2]
TOLD = re.compile(r"([−-]?\d[\d.]*)(?: points)? \[([−-]?\d[\d.]*), ([−-]?\d[\d.]*)\]")
NEAR = 0.035  # of the wider interval: so near lie two intervals of one number that was resampled twice


def told() -> dict[str, dict[tuple[float, float], set[str]]]:
    """What the notebooks glue: mean → interval → pages."""
    found: dict[str, dict[tuple[float, float], set[str]]] = defaultdict(lambda: defaultdict(set))
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for cell in json.loads(path.read_text(encoding="utf8"))["cells"]:
            for output in cell.get("outputs", []):
                text = output.get("data", {}).get("application/papermill.record/text/plain", "")
                for value, *ends in TOLD.findall("".join(text)):
                    low, high = (float(end.replace("−", "-")) for end in ends)
                    found[value][low, high].add(path.stem)
    return found


def twice(found: dict[str, dict[tuple[float, float], set[str]]]) -> list[str]:
    """The means of three digits or more that have two intervals so near to each other that they are of one number."""
    lines = []
    for value, intervals in found.items():
        if len(re.sub(r"\D", "", value)) < 3:
            continue
        for one, other in combinations(intervals, 2):
            width = max(one[1] - one[0], other[1] - other[0])
            if all(abs(a - b) < NEAR * width for a, b in zip(one, other, strict=True)):
                lines.append(f"{value}: {one} {intervals[one]}, {other} {intervals[other]}")
    return lines


def test_no_mean_has_two_intervals() -> None:
    assert twice(told()) == []


def test_a_mean_with_two_intervals_is_seen() -> None:
    near = {"1613": {(797.0, 2537.0): {"a"}, (824.0, 2539.0): {"b"}}}
    apart = {"579": {(479.0, 676.0): {"a"}, (-7.0, 1118.0): {"b"}}}
    assert len(twice(near)) == 1
    assert twice(apart) == []


@pytest.fixture(scope="module")
def outcomes():
    return study_pages.shipped()


def test_all_ways_to_a_number_give_one_interval(outcomes) -> None:
    pair = Contrast("standard", "ppo", "logit-normal", "gaussian")
    first, second = (outcomes.find(column, "HalfCheetah") for column in pair.columns)
    values = [scores(each, "final") for each in (first, second)]
    ways = [
        minus(*values),
        statistics.combination(values, [1, -1]),
        analysis.difference_of(first, second, "final"),
        analysis.differences(outcomes, pair, "final")["HalfCheetah"].difference,
        *(
            row.difference
            for row in compared(outcomes, "standard", ["final"])
            if row.robot == "HalfCheetah" and row.contrast == pair
        ),
    ]
    assert len(ways) == 5
    assert len({(float(each.low), float(each.high)) for each in ways}) == 1
    planned = analysis.differences(outcomes, pair, "final", as_planned=True)["HalfCheetah"]
    assert planned.difference.low != ways[0].low
    assert planned.p_value == analysis.differences(outcomes, pair, "final")["HalfCheetah"].p_value
    means = [
        mean_of(values[0]),
        analysis.estimate(first, "final"),
        pooled_estimate([first], "final"),
        statistics.combination(values[:1], [1]),
    ]
    assert len({(float(each.low), float(each.high)) for each in means}) == 1
