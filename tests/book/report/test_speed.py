"""The book's tables of speed hold what was measured, and say so where nothing was."""

import json
import re
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inbounds.book.report import speed
from tests.made_up_speed import made_up_results, ppo_turns, turn


def made_up_speed() -> dict[str, Any]:
    hopper = {**ppo_turns(), "sb3-ppo-plain": [turn(10, 1.0)] * 3}
    ant = {"inbounds-ppo-10": hopper["inbounds-ppo-10"], "inbounds-ppo-1": [turn(10, 0.3)] * 3}
    return made_up_results({"Hopper-v5": hopper, "Ant-v5": ant})


@pytest.fixture
def results(tmp_path: Path) -> Any:
    (tmp_path / "speed.json").write_text(json.dumps(made_up_speed()))
    return speed.read_speed(tmp_path)


def rows(html: str) -> list[list[str]]:
    body = html.partition("<tbody>")[2]
    return [
        [
            cell.replace("<br>", " ").partition(">")[2].partition("<")[0]  # of several lines
            for cell in re.split("<t[hd]", row)[1:]
        ]
        for row in body.split("<tr>")[1:]
    ]


def test_ratios_are_paired_and_the_floor_comes_last(results: Any) -> None:
    assert speed.median_ratio(results, "Hopper-v5", "inbounds-ppo-10", "sb3-ppo") == 10
    html = speed.ratio_table(results).html
    assert re.findall('<th scope="col"[^>]*>([^<]*)', html) == ["Who, over whom", "Hopper", "Ant"]
    assert rows(html) == [
        ["In Bounds PPO, S = 10, over stable-baselines3 PPO", "10.00 (10.00 to 20.00)", "–"],
        [
            "In Bounds PPO, S = 10, over stable-baselines3 PPO, observations as they are",
            "5.00 (2.50 to 10.00)",
            "–",
        ],
        ["In Bounds PPO, S = 10, over In Bounds PPO, S = 1", "–", "1.50 (0.75 to 3.00)"],
        ["In Bounds PPO, S = 10, over the floor", "0.25 (0.12 to 0.50)", "–"],
    ]


def test_the_circumstances_are_told(results: Any) -> None:
    html = speed.how_measured(results).html
    for words in (
        "<code>python -m made_up</code>",
        "P &amp; Q",
        "3 interleaved repeats",
        "Not measured: sbx-ppo",
    ):
        assert words in html


@pytest.fixture
def on_page(monkeypatch: pytest.MonkeyPatch) -> list[tuple[dict, dict]]:
    """Data and metadata of what is displayed."""
    caught: list[tuple[dict, dict]] = []
    monkeypatch.setattr(
        "IPython.display.display", lambda data, metadata=None, raw=False: caught.append((data, metadata))
    )
    return caught


def test_what_was_not_measured_is_called_missing(tmp_path: Path, on_page: list) -> None:
    assert speed.read_speed(tmp_path) is None
    assert speed.read_validation(tmp_path) is None
    assert speed.read_anchor(tmp_path) is None
    assert "<code>make bench</code>" in speed.ratio_table(None)._repr_html_()
    assert "benchmarks.validate" in speed.verdict_table(None)._repr_html_()
    assert "benchmarks.anchor" in speed.anchor_table(None)._repr_html_()
    assert "Missing" in speed.how_measured(None)._repr_html_()
    speed.show_speed(None)
    speed.show_validation(None)
    speed.show_anchor(None)
    assert len(on_page) == 3
    assert all("Missing" in data["text/html"] for data, _ in on_page)


def test_the_stored_text_is_the_same_measured_or_not(results: Any, on_page: list) -> None:
    """A new benchmark must not make the stored notebooks stale."""
    speed.show_speed(results)
    speed.show_speed(None)
    assert on_page[0][0]["text/plain"] == on_page[1][0]["text/plain"]
    for table in (speed.ratio_table, speed.how_measured):
        assert repr(table(results)) == repr(table(None))
    assert repr(speed.verdict_table(None)) == "<validation: verdicts>"


def test_the_plot_has_its_alt_text(results: Any, on_page: list) -> None:
    before = plt.get_fignums()
    speed.show_speed(results)
    ((data, metadata),) = on_page
    assert "logarithmic axis" in metadata["image/png"]["alt"]
    assert not any(character.isdigit() for character in data["text/plain"])
    assert plt.get_fignums() == before


def validation(folder: Path) -> Any:
    rng = np.random.default_rng(0)
    table = {"env": [], "who": [], "seed": [], "env_steps": [], "return_mean": []}
    for who in ("inbounds", "stable-baselines3"):
        for seed in range(3):
            for epoch in range(4):
                values = ("Hopper-v5", who, seed, 2048 * (epoch + 1), 100 * epoch + rng.normal())
                for column, value in zip(table.values(), values, strict=True):
                    column.append(value)
    pq.write_table(pa.table(table), folder / "curves.parquet")
    side = {"mean": 1234.4, "std": 56.0}
    sides = {"inbounds": side, "stable-baselines3": side}
    decided = {
        "ratio": 1.012,
        "low": 0.93,
        "high": 1.1,
        "p_value": 0.0123,
        "equivalent": True,
        "seeds_needed": 8,
    }
    verdicts = {
        "Hopper-v5": sides | decided,
        "Ant-v5": sides | decided | {"equivalent": False, "seeds_needed": 31},
        "Walker2d-v5": sides | {"undecided": "train longer"},
    }
    seeds = {"Hopper-v5": 3, "Ant-v5": 4, "Walker2d-v5": 3}
    found = {"seeds": seeds, "env_steps": 8192, "margin": 0.15, "verdicts": verdicts}
    (folder / "validation.json").write_text(json.dumps(found))
    return speed.read_validation(folder)


def test_verdicts_say_what_was_shown_and_what_was_not(tmp_path: Path) -> None:
    html = speed.verdict_table(validation(tmp_path)).html
    same = ["1,234 ± 56", "1,234 ± 56"]
    hopper, ant, walker = rows(html)
    assert hopper == ["Hopper-v5", *same, "1.01 [0.93,\N{NO-BREAK SPACE}1.10]", "0.012", "equivalent"]
    assert ant[-1].startswith("not shown; with equal means 31 seeds")
    assert walker == ["Walker2d-v5", *same, "–", "–", "undecided: train longer"]
    assert "seeds a side (3 on Hopper-v5, 4 on Ant-v5, 3 on Walker2d-v5), 8,192 env steps" in html
    assert "within ± 15\N{NARROW NO-BREAK SPACE}%" in html


def test_areas_above_the_start_do_not_depend_on_where_zero_is(tmp_path: Path) -> None:
    found = validation(tmp_path)
    here = speed.above_the_start(found, "Hopper-v5")
    returns = pa.array(found["curves"]["return_mean"].to_numpy() + 1000.0)
    column = found["curves"].schema.get_field_index("return_mean")
    there = speed.above_the_start(
        {**found, "curves": found["curves"].set_column(column, "return_mean", returns)}, "Hopper-v5"
    )
    assert there["start"] - here["start"] == pytest.approx(1000)
    for key in ("ratio", "low", "high"):
        assert there[key] == pytest.approx(here[key])
    assert here["ratio"] == pytest.approx(1, abs=0.02)  # both sides climb by 150 on average
    assert there["margin"] - here["margin"] == pytest.approx(150)  # 15 % of another zero


def test_half_a_validation_is_none(tmp_path: Path) -> None:
    """Verdicts without the curves behind them, as an interrupted copy would leave them."""
    assert validation(tmp_path) is not None
    (tmp_path / "curves.parquet").unlink()
    assert speed.read_validation(tmp_path) is None


def test_the_curves_of_both_sides_are_drawn(tmp_path: Path, on_page: list) -> None:
    found = validation(tmp_path)
    verdicts = {"Hopper-v5": found["verdicts"]["Hopper-v5"]}
    speed.show_validation({**found, "verdicts": verdicts})
    ((_, metadata),) = on_page
    assert "stable-baselines3" in metadata["image/png"]["alt"]


def anchor(folder: Path) -> Any:
    """An anchor's results with each of its words, as `benchmarks.anchor` writes them."""
    sides = {"inbounds": {"mean": 1234.4, "std": 56.0}, "stable-baselines3": {"mean": -12.0, "std": 7.6}}
    numbers = {
        "margin": 1170.0,
        "difference": -1246.4,
        "interval_90": [-1300.0, 2.4],
        "p_value": 0.0123,
        "seeds_needed": 31,
    }
    validation(folder)
    verdicts = {
        "Ant-v5": sides | numbers | {"word": "different"},
        "Hopper-v5": sides | numbers | {"word": "undecided"},
        "Walker2d-v5": sides | {"margin": 170.0, "word": "undecided", "reason": "no return"},
    }
    found = {"seeds": {"Ant-v5": 10, "Hopper-v5": 3}, "env_steps": 8192, "verdicts": verdicts}
    (folder / "anchor.json").write_text(json.dumps(found))
    return speed.read_anchor(folder)


def test_the_anchor_says_its_word_and_its_numbers(tmp_path: Path) -> None:
    shown = speed.anchor_table(anchor(tmp_path))
    assert repr(shown) == repr(speed.anchor_table(None))
    ant, hopper, walker = rows(shown.html)
    same = ["1234 ± 56.0", "−12.0 ± 7.6"]
    numbers = ["−1246 [−1300,\N{NO-BREAK SPACE}2.4]", "± 1170", "0.012"]
    assert ant == ["Ant-v5", *same, *numbers, "different"]
    assert hopper[:-1] == ["Hopper-v5", *same, *numbers]
    assert hopper[-1].startswith("undecided; with equal means 31 seeds a side")
    assert walker == ["Walker2d-v5", *same, "–", "± 170", "–", "undecided: no return"]
    assert "(10 on Ant-v5, 3 on Hopper-v5), 8,192 env steps each" in shown.html


def test_the_curves_of_the_anchor_are_drawn(tmp_path: Path, on_page: list) -> None:
    found = anchor(tmp_path)
    speed.show_anchor({**found, "verdicts": {"Hopper-v5": found["verdicts"]["Hopper-v5"]}})
    ((_, metadata),) = on_page
    assert metadata["image/png"]["alt"].startswith("Over a million steps: return in training")


def test_without_the_source_tree_the_error_says_what_to_do(
    results: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(speed, "ROOT", tmp_path)
    with pytest.raises(ModuleNotFoundError, match="clone the project"):
        speed.ratio_table(results)


@pytest.mark.parametrize("first", [[], [str(speed.ROOT)]])
def test_the_path_is_left_as_it_was(results: Any, monkeypatch: pytest.MonkeyPatch, first: list[str]) -> None:
    """Also where it begins with the source tree, as in `python -m`."""
    import sys

    before = first + sys.path
    monkeypatch.setattr(sys, "path", list(before))
    speed.ratio_table(results)
    assert sys.path == before
