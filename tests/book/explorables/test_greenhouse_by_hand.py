"""The greenhouse in JavaScript goes through the package's states, actions and returns; its data are shipped."""

import dataclasses
import itertools
import json
from typing import Any

import numpy as np
import pytest

from inbounds.book.explorables.greenhouse_by_hand import DAYS, WHO, HandRule, a_day, greenhouse_by_hand
from inbounds.book.own_task import greedy, play
from inbounds.book.own_task import greenhouse as house
from inbounds.book.own_task import greenhouse_runs as runs
from tests.book.colour_vision import GROUNDS, assert_looks_differ
from tests.book.explorables.test_bounded_densities import run_js

MODEL = 'inbounds.models["greenhouse-by-hand"]'
CALL = f"points.map(([which, night, day, gain, opens]) => {MODEL}({{ which, night, day, gain, opens }}))"
RNG = np.random.default_rng(13)
CHAPTER = (22.0, 22.0, 4.0, 23.0)
# The chapter's rule, corners of the sliders (some lose the crop), and points in between, on each of the days.
POINTS = [
    *((which, *CHAPTER) for which in range(3)),
    *((which, 22.0, 21.0, 4.0, 22.0) for which in range(3)),
    *itertools.product(range(3), (15.0, 26.0), (15.0, 26.0), (0.0, 8.0), (20.0, 30.0)),
    *(
        [which, *RNG.uniform([15, 15, 0, 20], [26, 26, 8, 30]).tolist()]
        for which in range(3)
        for _ in range(4)
    ),
]


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    return run_js(CALL, points=POINTS)


def seed_of(which: int) -> int:
    return list(DAYS.values())[which]


def test_days_are_days_for_choosing_and_the_rule_is_the_chapters() -> None:
    envs = house.GreenhouseBatch(len(runs.CHOSEN_BY))
    envs.reset(seed=list(runs.CHOSEN_BY))
    inside, _, season, sky = envs.state
    by_season = np.array(runs.CHOSEN_BY)[np.argsort(season)]
    assert list(DAYS.values()) == [by_season[0], by_season[20], by_season[-1]]
    found = run_js("inbounds.greenhouse")
    np.testing.assert_array_equal(found["DAYS"], np.stack([inside, season, sky], -1))
    assert [runs.CHOSEN_BY[i] for i in found["SHOWN"]] == list(DAYS.values())
    assert tuple(found["CHAPTER"].values()) == CHAPTER
    obs = np.random.default_rng(0).uniform(-5, 40, (500, 5)).astype(np.float32)
    np.testing.assert_array_equal(HandRule().act(obs), house.thermostat(22, 4, 23)(obs))


def test_javascript_goes_through_the_states_of_the_environment(states: list[dict[str, Any]]) -> None:
    chapter = [a_day(HandRule().act, seed) for seed in DAYS.values()]
    lost = 0
    for point, state in zip(POINTS, states, strict=True):
        rule = HandRule(*point[1:])
        yours = a_day(rule.act, seed_of(int(point[0])))
        for name, expected in (("yours", yours), ("chapter", chapter[int(point[0])])):
            found = state["found"][name]
            for part in ("outside", "power", "vent", "reward"):
                np.testing.assert_allclose(found[part], expected[part], rtol=0, atol=1e-9)
            np.testing.assert_allclose(found["inside"][:-1], expected["inside"][:-1], rtol=0, atol=1e-9)
            assert found["inside"][-1] == pytest.approx(expected["inside"][-1], abs=1e-5)  # single precision
            assert found["earned"] == pytest.approx(expected["reward"].sum(), abs=1e-9)
            assert found["lost"] == (
                len(expected["reward"]) < house.DAY or not 5 < expected["inside"][-1] < 35
            )
        lost += state["found"]["yours"]["lost"]
        obs = house.observe(np.array(state["found"]["yours"]["inside"][:1]), 0, 0.0, 1.0)
        assert state["found"]["yours"]["asked"][0] == pytest.approx(float(rule.asks(obs)[0]), abs=1e-9)
    assert 3 < lost < len(POINTS) - 10


def test_what_is_lost_and_paid_adds_up(states: list[dict[str, Any]]) -> None:
    for point, state in zip(POINTS, states, strict=True):
        day = a_day(HandRule(*point[1:]).act, seed_of(int(point[0])))
        after, found = day["inside"][1:], state["found"]["yours"]
        missing = 1 - np.exp(-(((after - 21) / 6) ** 2))
        assert found["cold"] == pytest.approx(missing[after < 21].sum(), abs=1e-5)
        assert found["warm"] == pytest.approx(missing[after >= 21].sum(), abs=1e-5)
        assert found["pump"] == pytest.approx(0.02 * np.abs(day["power"]).sum(), abs=1e-9)
        assert len(after) - found["earned"] == pytest.approx(found["cold"] + found["warm"] + found["pump"])


def test_means_are_those_of_the_days_for_choosing(states: list[dict[str, Any]]) -> None:
    for point, state in list(zip(POINTS, states, strict=True))[::7]:
        expected = play(HandRule(*point[1:]).act, house.GreenhouseBatch, runs.CHOSEN_BY).mean()
        assert state["means"]["yours"] == pytest.approx(expected, abs=1e-9)


def test_the_learned_policy_is_the_shipped_one(states: list[dict[str, Any]]) -> None:
    act, data = greedy(runs.policies("logit-normal")[0]), run_js("inbounds.greenhouse")
    for state, seed in zip(states, DAYS.values(), strict=False):  # the first three points: a day each
        expected, found = a_day(act, seed), state["found"]["learned"]
        for part in ("power", "vent"):
            np.testing.assert_allclose(found[part], expected[part], atol=2e-3)
        assert found["earned"] == pytest.approx(expected["reward"].sum(), abs=0.01)
    assert play(act, house.GreenhouseBatch, runs.CHOSEN_BY).mean() == pytest.approx(
        data["MEAN"]["learned"], abs=0.01
    )
    planned = house.planned(runs.CHOSEN_BY)
    assert planned[[seed - runs.CHOSEN_BY[0] for seed in DAYS.values()]] == pytest.approx(
        data["PLANNED"], abs=0.01
    )


def test_table_and_note(states: list[dict[str, Any]]) -> None:
    explorable = greenhouse_by_hand()
    seen = set()
    for state in states:
        found, table, note = state["found"], state["table"], state["note"]
        assert set(table) == set(explorable.rows)
        assert {len(cells) for cells in table.values()} == {len(explorable.columns)}
        for key in ("earned", "cold", "warm", "pump"):
            shown = [float(cell.replace("−", "-")) for cell in table[key]]
            assert shown == pytest.approx([found[name][key] for name in explorable.columns], abs=0.0501)
        yours = found["yours"]
        inside = np.array(yours["inside"][1:])
        assert float(table["hours"][0]) == ((inside >= 17) & (inside <= 25)).sum() / 4
        for row, part, bounds in (("pump_bound", "power", (-2, 8)), ("vent_bound", "vent", (0, 1))):
            for name, cell in zip(explorable.columns, table[row], strict=True):
                near = np.abs(np.subtract.outer(found[name][part], bounds)).min(-1) <= 0.001 * np.ptp(bounds)
                assert float(cell.rstrip("\u00a0%")) == pytest.approx(100 * near.mean(), abs=0.501)
        assert table["asked"][0].startswith(f"{max(yours['asked']):.1f}".replace("-", "−"))
        if yours["lost"]:
            hour, minute = divmod(15 * len(yours["reward"]), 60)
            assert note.startswith(f"The crop is lost at {hour}:{minute:02d},")
            seen.add("lost")
            continue
        lead = yours["earned"] - found["chapter"]["earned"]
        word = "what the chapter's does" if abs(lead) < 0.05 else "more than" if lead > 0 else "less than"
        assert word in note
        most = max(("cold", "warm", "pump"), key=lambda key: yours[key])
        assert (
            f"points is { {'warm': 'warmth', 'pump': 'the pump'}.get(most, most) }, {yours[most]:.1f}" in note
        )
        seen |= {word, most}
    assert seen == {"lost", "what the chapter's does", "more than", "less than", "cold", "warm", "pump"}


def test_html_and_fallback() -> None:
    explorable = greenhouse_by_hand("warm", 21.0, 20.0, 2.0, 22.0)
    html = explorable.html(live=False)
    assert len(html) < 140_000
    assert html.count('<th scope="row"><svg') == 1  # the dotted line stands beside its row
    (state,) = run_js(CALL, points=[(2, 21.0, 20.0, 2.0, 22.0)])
    yours, chapter = (state["found"][name]["earned"] for name in ("yours", "chapter"))
    assert f"earns {yours:.1f}, the chapter's {chapter:.1f}." in explorable.alt
    document = json.dumps(explorable._item)
    names = [*state["sources"], *state["ranges"]]
    assert all(f'\\"name\\":\\"{name}\\"' in document for name in names)
    lines = {line.get_label(): line.get_data() for line in explorable.fallback().axes[0].lines}
    for name in explorable.columns:
        assert WHO[name].color in html
        x, y = lines[WHO[name].label]
        source = state["sources"][f"{name}-inside"]
        np.testing.assert_allclose(np.asarray(x, float), source["x"])
        np.testing.assert_allclose(np.asarray(y, float), source["y"], atol=5e-3)


@pytest.mark.parametrize("bad", [{"day": "rainy"}, {"night_aim": 14.0}, {"gain": 9.0}, {"opens": 31.0}])
def test_values_outside_the_sliders_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="choose"):
        greenhouse_by_hand(**bad)


@pytest.mark.parametrize("ground", GROUNDS)
def test_looks_differ_under_every_colour_vision(ground: str) -> None:
    assert_looks_differ([WHO[name] for name in ("yours", "chapter", "learned")], ground)
    everything = enumerate(WHO.values())
    assert_looks_differ([dataclasses.replace(look, linestyle=str(i)) for i, look in everything], ground)
