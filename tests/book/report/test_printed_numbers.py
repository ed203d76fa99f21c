"""What *What happened* and *Which policy?* print, beside the independent analysis of `results/`, final return and area.

The pages' own hidden cells are run, and what they glue is caught. The other side takes nothing from `inbounds`: it
reads the cells' files by their names, and its statistics are those that hold the second study's analysis
(`tests/study/second/independent.py`). Where an interval's end or a p-value is so near its limit that the resampling
decides the word, the word is not compared, and such rows are few.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pyarrow.parquet as pq
import pytest

from inbounds.book.report import answers, study_pages
from inbounds.book.report.over_all_robots import over_all_robots
from inbounds.study.second import MARGINS
from tests.study.second import independent
from tests.study.second.independent_statistics import (
    bootstrap_difference,
    expanded_share,
    holm,
    permutation_p,
)

ROOT = Path(__file__).resolve().parents[3]
CELLS = ROOT / "results" / "cells"
DRAWS = 40_000
ENDPOINTS, ROBOTS = independent.ENDPOINTS, independent.ROBOTS
LAST = {"second-done", "capg-trpo-area-half"}
"""Glued last before a page's first view: by *Which policy?* and *What happened*, and by *Why*."""


@dataclass(frozen=True)
class Gap:
    """A difference of two means, by other means than the package's."""

    value: float
    low: float
    high: float
    p: float
    error: float
    """Of an interval's end, from the resampling on both sides: a share of its width."""

    @property
    def near(self) -> bool:
        """Whether the resampling, or the pages' hundredth of a width, decides if the interval holds 0."""
        return min(abs(self.low), abs(self.high)) < (self.high - self.low) * 0.035

    @property
    def side(self) -> int:
        return int(self.low > 0) - int(self.high < 0)


@cache
def seeds_of(name: str) -> independent.Runs:
    about = json.loads(pq.read_schema(CELLS / f"{name}.parquet").metadata[b"inbounds"])
    return independent._runs(CELLS / f"{name}.parquet", about["config"])


def there(*names: str) -> list[str]:
    return [name for name in names if (CELLS / f"{name}.parquet").is_file()]


@cache
def gap(first: tuple[str, ...], second: tuple[str, ...], endpoint: str) -> Gap:
    """First minus second, the seeds of each side's cells together."""
    x, y = (np.concatenate([seeds_of(name).endpoint(endpoint) for name in side]) for side in (first, second))
    rng = np.random.default_rng([len(x), *endpoint.encode(), *"".join(first).encode()])
    share = expanded_share(x, y)
    low, high = np.quantile(bootstrap_difference(x, y, rng, DRAWS), [share, 1 - share])
    return Gap(x.mean() - y.mean(), low, high, permutation_p(x, y, rng, 9999), (high - low) * 0.03)


@cache
def printed(page: str) -> dict[str, Any]:
    """Run a page's hidden cells up to the first that shows something; return its names, and what it glues."""
    glued: dict[str, Any] = {}
    names: dict[str, Any] = {}
    for cell in nbformat.read(ROOT / "notebooks" / f"{page}.ipynb", as_version=4).cells:
        hidden = {"remove-cell", "hide-input"} & set(cell.metadata.get("tags", []))
        if (
            cell.cell_type != "code"
            or not hidden
            or re.match(r"study_pages|answers|as_they_come|study_explorer", cell.source)
        ):
            continue
        exec(compile(cell.source, page, "exec"), names)
        names["glue"] = lambda name, value, display: glued.update({name: value})
        if LAST & glued.keys():
            break
    return names | {"glued": glued}


def law_cells(algorithm: str, law: str, robot: str) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """The files behind a law and its equally quiet Gaussian: the second study's if both are there, else the first's."""
    low = robot.lower()
    pair = [
        there(*(f"{arm}-{low}-{algorithm}-{family}" for arm in ("equal", "equal-more")))
        for family in (law, "gaussian-free-std")
    ]
    if all(pair):
        return tuple(pair[0]), tuple(pair[1])
    quiet = {
        family: there(
            *(f"{arm}-{low}-{algorithm}-{family}-matched-noise" for arm in ("mechanisms", "afterwards"))
        )
        for family in (law, "gaussian")
    }
    bounded = quiet[law] or there(*(f"{arm}-{low}-{algorithm}-{law}" for arm in ("standard", "beyond")))
    return ((bounded[0],), (quiet["gaussian"][0],)) if bounded and quiet["gaussian"] else None


def same(row: Any, mine: Gap) -> None:
    """A bar of a forest: value to rounding, ends to what resampling leaves open."""
    assert float(row.difference.value) == pytest.approx(mine.value, rel=1e-9, abs=1e-9)
    assert float(row.difference.low) == pytest.approx(mine.low, abs=mine.error)
    assert float(row.difference.high) == pytest.approx(mine.high, abs=mine.error)


def law_rows() -> Iterator[tuple[str, str, str, str, Gap]]:
    for algorithm in ("ppo", "trpo"):
        for law in ("beta", "logit-normal"):
            for endpoint in ENDPOINTS:
                for robot in ROBOTS:
                    if files := law_cells(algorithm, law, robot):
                        yield algorithm, law, endpoint, robot, gap(*files, endpoint)


def listed_in(text: str) -> dict[str, list[str]]:
    """The robots by what a page's words say of them; where it names none, as many empty names as it counts."""
    words = "suggested above|suggested below|above|below|too small to matter|no difference found"
    found = re.findall(rf"({words}) on (\w+)(?: of (\d+) robots?)?(?: \(([^)]*)\))?", text)
    listed: dict[str, list[str]] = {"above": [], "below": []}  # which a page leaves out where there are none
    for word, count, _, robots in found:
        number = int(count)
        listed[word] = robots.split(", ") if robots else [""] * number
        assert len(listed[word]) == number, text
    assert int(found[0][2]) == sum(map(len, listed.values())), text
    return listed


def told_of(listed: dict[str, list[str]], found: dict[str, Gap]) -> None:
    """Every robot is told of, on the side on which its interval lies, unless that is close."""
    assert sum(map(len, listed.values())) == len(found)
    for robot, mine in found.items():
        for word, side in (("above", 1), ("below", -1)):
            said = robot in listed[word] + listed.get(f"suggested {word}", [])
            small = robot in listed.get("too small to matter", [])
            assert mine.near or small or said == (mine.side == side), (robot, listed)


@pytest.mark.parametrize("page", ["which_policy", "what_happened"])
def test_from_an_equal_start(page: str) -> None:
    """Every bar of the forests; and on how many robots a law is above and below, in the page's words."""
    names = printed(page)
    rows = {(r.algorithm, r.law, r.endpoint, r.robot): r for r in names["rows"]}
    mine = {key[:4]: key[4] for key in law_rows()}
    assert set(rows) == set(mine)
    for key, row in rows.items():
        same(row, mine[key])
    assert sum(each.near for each in mine.values()) <= len(mine) / 6
    compared = 0
    for algorithm, law, endpoint in dict.fromkeys(key[:3] for key in mine):
        here = {key[3]: found for key, found in mine.items() if key[:3] == (algorithm, law, endpoint)}
        listed = listed_in(names["glued"][f"{law}-{algorithm}-{endpoint}"])
        told_of(listed, here)
        compared += len(here)
    assert compared == len(mine)


def as_printed(numbers: tuple[str, ...], found: Gap) -> None:
    """Value and both ends, to the digits that a page shows."""
    value, low, high = (float(number.replace("−", "-")) for number in numbers)
    digit = 0.51 if abs(value) >= 100 else 0.051
    assert value == pytest.approx(found.value, abs=digit)
    assert (low, high) == pytest.approx((found.low, found.high), abs=found.error + digit)


def test_the_differences_that_are_named() -> None:
    """*Which policy?*: robot, value and interval of each final return's difference that leaves out 0."""
    glued, mine, seen = printed("which_policy")["glued"], {key[:4]: key[4] for key in law_rows()}, 0
    for algorithm, law, endpoint in dict.fromkeys(key[:3] for key in mine):
        name = f"{law}-{algorithm}-leads"
        if name not in glued or endpoint != "final":
            continue
        told = re.findall(r"(\w+) ([−\d.]+) \[([−\d.]+), ([−\d.]+)\] \((.+?)\)", glued[name])
        assert {each[0] for each in told} >= {
            key[3]
            for key, found in mine.items()
            if key[:3] == (algorithm, law, endpoint) and found.side and not found.near
            if max(abs(found.low), abs(found.high)) > MARGINS[endpoint][key[3]]  # else it may be refuted
        }
        for robot, *numbers, _ in told:
            as_printed(tuple(numbers), mine[algorithm, law, endpoint, robot])
            seen += 1
    assert seen


@pytest.mark.parametrize("algorithm", ["ppo", "trpo"])
def test_the_rows_that_who_wins_leads_to(algorithm: str) -> None:
    """*What happened*: every robot's row below a forest, each law and endpoint, or *not run*."""
    page = answers.by_endpoint(printed("what_happened")["rows"], algorithm)._repr_html_()
    mine, seen = {key[:4]: key[4] for key in law_rows()}, 0
    for robot in ROBOTS:
        row = re.search(rf'<tr id="{answers.place_of(robot, algorithm)}".*?</tr>', page, re.DOTALL)
        assert row is not None
        _, *cells = re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row[0], re.DOTALL)
        keys = [
            (algorithm, law, endpoint, robot) for endpoint in ENDPOINTS for law in ("beta", "logit-normal")
        ]
        for key, cell in zip(keys, cells, strict=True):
            told = re.search(r"([−\d.]+)\s\[([−\d.]+),\s([−\d.]+)\]", cell)
            assert (told is None) == (key not in mine), cell
            if told:
                as_printed(told.groups(), mine[key])
                seen += 1
            else:
                assert "not run" in cell
    assert seen == sum(key[0] == algorithm for key in mine)


def quiet_and_plain(robot: str, algorithm: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The cells of a quiet Gaussian and of one as it comes: the second study's under PPO, where it has them."""
    low = robot.lower()
    if algorithm == "ppo" and (plain := there(f"as-they-come-{low}-ppo-gaussian-free-std")):
        free = f"{low}-ppo-gaussian-free-std"
        return tuple(there(f"equal-{free}", f"equal-more-{free}")), tuple(plain)
    names = (f"{arm}-{low}-{algorithm}-gaussian-matched-noise" for arm in ("mechanisms", "afterwards"))
    return tuple(there(*names)[:1]), (f"standard-{low}-{algorithm}-gaussian",)


def test_a_quiet_start() -> None:
    """A quiet Gaussian minus one as it comes, all bars and the count on the answer page."""
    names = printed("which_policy")
    counts: dict[str, dict[str, Gap]] = {}
    for row in names["starts"]:
        mine = gap(*quiet_and_plain(row.robot, row.algorithm), row.endpoint)
        fresh = row.algorithm == "ppo" and there(f"as-they-come-{row.robot.lower()}-ppo-gaussian-free-std")
        assert row.study == (2 if fresh else 1)
        same(row, mine)
        if row.endpoint == "final":
            counts.setdefault(row.algorithm, {})[row.robot] = mine
    for algorithm, found in counts.items():
        told_of(listed_in(names["glued"][f"quiet-{algorithm}-sure"]), found)


@pytest.mark.parametrize("law", ["beta", "logit-normal"])
def test_against_what_people_run(law: str) -> None:
    """A quiet law minus a Gaussian with a free σ that starts at 1: the counts of the answer page, and its numbers."""
    glued = printed("which_policy")["glued"]
    mine = {}
    for robot in ROBOTS:
        low = robot.lower()
        quiet = there(*(f"{arm}-{low}-ppo-{law}" for arm in ("equal", "equal-more")))
        mine[robot] = gap(tuple(quiet), (f"as-they-come-{low}-ppo-gaussian-free-std",), "final")
    said = dict(map(reversed, re.findall(r"(\d+)\s(above|below)", glued[f"{law}-usual"])))
    above, below = (int(said.get(word, 0)) for word in ("above", "below"))
    near = sum(each.near for each in mine.values())
    assert abs(above - sum(each.side > 0 for each in mine.values())) <= near
    assert abs(below - sum(each.side < 0 for each in mine.values())) <= near
    assert near <= 1
    told = re.findall(r"(\w+) (\S+) \[(\S+), (\S+)\]", glued[f"{law}-usual-leads"])
    assert len(told) == above + below
    for robot, *numbers in told:
        as_printed(tuple(numbers), mine[robot])


@pytest.mark.parametrize(
    ("name", "kind", "endpoint"),
    [
        ("law-free", "-free-std", "final"),
        ("law-free-area", "-free-std", "area"),
        ("law-state", "", "final"),
        ("law-state-area", "", "area"),
    ],
)
def test_the_law_with_one_kind_of_sigma(name: str, kind: str, endpoint: str) -> None:
    """*What happened*: the logit-normal minus a Gaussian whose σ is free, or of the state, as its own is."""
    listed = listed_in(printed("what_happened")["glued"][name])
    mine = {}
    for robot in ROBOTS:
        sides = [
            there(*(f"{arm}-{robot.lower()}-ppo-{law}{kind}" for arm in ("equal", "equal-more")))
            for law in ("logit-normal", "gaussian")
        ]
        mine[robot] = gap(tuple(sides[0]), tuple(sides[1]), endpoint)
    compared = 0
    for robot, p in zip(ROBOTS, holm(np.array([mine[robot].p for robot in ROBOTS])), strict=True):
        if mine[robot].near or 0.04 < p < 0.06:
            continue
        compared += 1
        for word, side in (("above", 1), ("below", -1)):
            assert (robot in listed[word]) == (mine[robot].side == side and p < 0.05), (robot, p)
            suggested = mine[robot].side == side and p >= 0.05
            assert (robot in listed.get(f"suggested {word}", [])) == suggested, (robot, p)
    assert compared >= (3 if name == "law-state-area" else 4)  # two p-values of 0.04


CONTRASTS = (
    ("ppo", "logit-normal", "gaussian"),
    ("ppo", "beta", "gaussian"),
    ("ppo", "logit-normal", "beta"),
    ("trpo", "logit-normal", "gaussian"),
)


@pytest.mark.parametrize("endpoint", ENDPOINTS)
def test_as_they_come(endpoint: str) -> None:
    """Bars; robots above and below after Holm over six; a dagger where Holm over all of the arm would not find it."""
    names = printed("what_happened")
    rows = {(*row.contrast[1:], row.robot): row for row in names["compared"] if row.endpoint == endpoint}
    mine: dict[tuple[str, ...], Gap] = {}
    for algorithm, first, second in CONTRASTS:
        for robot in ROBOTS:
            files = there(*(f"standard-{robot.lower()}-{algorithm}-{family}" for family in (first, second)))
            if len(files) == 2:
                mine[algorithm, first, second, robot] = gap((files[0],), (files[1],), endpoint)
    assert set(rows) == set(mine)
    places = [(*contrast, robot) for contrast in CONTRASTS for robot in ROBOTS]
    p_values = {place: mine[place].p if place in mine else np.nan for place in places}
    over_all = dict(zip(places, holm(np.array(list(p_values.values()))), strict=True))
    words = 0
    for contrast in CONTRASTS:
        six = holm(np.array([p_values[(*contrast, robot)] for robot in ROBOTS]))
        here = {r: p for r, p in zip(ROBOTS, six, strict=True) if (*contrast, r) in mine}
        name = f"come-{contrast[0]}-{contrast[1]}" + ("" if contrast[2] == "gaussian" else f"-{contrast[2]}")
        text = names["glued"][f"{name}-{endpoint}"]
        for word, side in (("above", 1), ("below", -1)):
            told = listed_in(text)[word]
            for robot, p in here.items():
                found = mine[(*contrast, robot)]
                same(rows[(*contrast, robot)], found)
                if found.near or 0.03 < p < 0.08:
                    continue
                words += 1
                assert (robot in [each.rstrip("†") for each in told]) == (found.side == side and p < 0.05), (
                    text
                )
                if robot in told or f"{robot}†" in told:
                    wide = over_all[(*contrast, robot)]
                    assert 0.03 < wide < 0.08 or (f"{robot}†" in told) == (wide >= 0.05), (text, wide)
    assert words >= len(mine)


def why_differences() -> Iterator[tuple[str, str, str, str]]:
    """Glued name, first and second cell, endpoint of each difference that *Why* tells."""
    for endpoint in ENDPOINTS:
        area = "-area" if endpoint == "area" else ""
        cheetah = "halfcheetah-trpo"
        yield (
            f"lead-cheetah{area}",
            f"standard-{cheetah}-logit-normal",
            f"standard-{cheetah}-gaussian",
            endpoint,
        )
        quiet = (f"afterwards-{cheetah}-{family}-matched-noise" for family in ("logit-normal", "gaussian"))
        yield f"left-cheetah{area}", *quiet, endpoint
        for robot in ("HalfCheetah", "Ant"):
            logit, gaussian = (f"standard-{robot.lower()}-trpo-{f}" for f in ("logit-normal", "gaussian"))
            loud = f"afterwards-{robot.lower()}-trpo-logit-normal-loud-noise"
            yield f"lost-{robot}-{endpoint}", logit, loud, endpoint
            yield f"left-{robot}-{endpoint}", loud, gaussian, endpoint
            yield f"lead-{robot}-{endpoint}", logit, gaussian, endpoint
        for algorithm in ("ppo", "trpo"):
            capg = f"beyond-halfcheetah-{algorithm}-clipped-gaussian"
            yield f"capg-{algorithm}-{endpoint}", capg, f"standard-halfcheetah-{algorithm}-gaussian", endpoint


def test_why() -> None:
    """Value and interval of each difference, as the three experiments print them; a verdict where that is all."""
    glued = printed("why")["glued"]
    verdicts = 0
    told = [(name, (first,), (second,), endpoint) for name, first, second, endpoint in why_differences()]
    told.append(("quiet-cheetah-trpo", *quiet_and_plain("HalfCheetah", "trpo"), "final"))
    told.append(("quiet-humanoid-free", *quiet_and_plain("Humanoid", "ppo"), "final"))
    fresh = law_cells("trpo", "logit-normal", "HalfCheetah")
    assert fresh
    told.append(("left-cheetah-fresh", *fresh, "final"))
    usual = "standard-humanoid-ppo-gaussian"
    told.append(("quiet-humanoid", ("afterwards-humanoid-ppo-gaussian-matched-noise",), (usual,), "final"))
    for name, first, second, endpoint in told:
        mine = gap(first, second, endpoint)
        numbers = [float(each.replace("−", "-")) for each in re.findall(r"[−-]?\d+(?:\.\d+)?", glued[name])]
        if "no difference found" in glued[name]:
            assert mine.side == 0 or mine.near, (name, glued[name])
            assert numbers == pytest.approx([mine.low, mine.high], abs=mine.error + 0.51), name
            verdicts += 1
            continue
        assert numbers[0] == pytest.approx(mine.value, abs=0.51), name
        assert numbers[1:3] == pytest.approx([mine.low, mine.high], abs=mine.error + 0.51), name
    assert verdicts  # CAPG's differences are told in words


def unit_scores(algorithm: str, family: str, endpoint: str) -> list[np.ndarray]:
    """Per robot: 0 the first epoch's mean return of PPO's Gaussian as it comes, 1 its mean final return."""
    found = []
    for robot in ROBOTS:
        reference = seeds_of(f"standard-{robot.lower()}-ppo-gaussian")
        zero, one = reference.returns[:, 0].mean(), reference.endpoint("final").mean()
        (name,) = there(*(f"{arm}-{robot.lower()}-{algorithm}-{family}" for arm in ("standard", "beyond")))
        found.append((seeds_of(name).endpoint(endpoint) - zero) / (one - zero))
    return found


def better(first: list[np.ndarray], second: list[np.ndarray]) -> float:
    """How often a run of the first beats one of the second, pair by pair, ties by half; mean over robots."""
    pairs = [
        [np.sign(x - y) / 2 + 0.5 for x in one for y in other]
        for one, other in zip(first, second, strict=True)
    ]
    return float(np.mean([np.mean(each) for each in pairs]))


@pytest.mark.parametrize("endpoint", ENDPOINTS)
def test_over_all_robots(endpoint: str) -> None:
    """IQM of normalised scores and probability of improvement, as *All tables* prints them for standard practice."""
    text = over_all_robots(study_pages.shipped(), "standard").html
    figure = re.findall(r'alt="IQM of the normalised (.+?) over all robots \(.+?\)\. (.+?)"', text)
    said = dict(figure)["final return" if endpoint == "final" else "area under the learning curve"]
    families = {"Gaussian, clipped": "gaussian", "Beta": "beta", "Logit-normal": "logit-normal"}
    compared = 0
    for algorithm, row in re.findall(r"(PPO|TRPO): ([^:]+?)(?=\. TRPO|$)", said):
        for label, number in re.findall(r"(Gaussian, clipped|Beta|Logit-normal) ([−\d.]+)", row):
            runs = np.concatenate(unit_scores(algorithm.lower(), families[label], endpoint))
            middle = np.sort(runs)[len(runs) // 4 : len(runs) - len(runs) // 4]
            assert float(number) == pytest.approx(middle.mean(), abs=0.0501)
            compared += 1
    assert compared == 5
    rows = re.findall(
        r'words">(PPO|TRPO)</th>\s*<td class="words">([\w-]+) − ([\w-]+)</td>((?:\s*<td>.*?</td>)+)', text
    )
    assert len(rows) == 4
    for algorithm, *names, cells in rows:
        told = re.findall(r"<td>([\d.]+) \[([\d.]+),\s([\d.]+)\]</td>", cells)[ENDPOINTS.index(endpoint)]
        sides = [unit_scores(algorithm.lower(), name.lower(), endpoint) for name in names]
        assert float(told[0]) == pytest.approx(better(*sides), abs=0.00501)
        rng = np.random.default_rng(list(algorithm.encode()))
        draws = [
            better(*([rng.choice(each, len(each)) for each in side] for side in sides)) for _ in range(300)
        ]
        assert [float(end) for end in told[1:]] == pytest.approx(
            np.quantile(draws, [0.025, 0.975]), abs=0.035
        )


def test_a_wrong_number_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the last fifty epochs the last forty, or one seed lost, the bars would not agree."""
    names = printed("which_policy")
    row = next(r for r in names["rows"] if (r.robot, r.algorithm, r.endpoint) == ("Ant", "ppo", "final"))
    first, second = law_cells("ppo", row.law, "Ant") or ((), ())
    right = gap(first, second, "final")
    shorter: Callable[..., Any] = lambda self, _: independent.repeated(self.returns)[:, -40:].mean(1)  # noqa: E731
    monkeypatch.setattr(independent.Runs, "endpoint", shorter)
    wrong = gap.__wrapped__(first, second, "final")
    same(row, right)
    with pytest.raises(AssertionError):
        same(row, wrong)
