"""The dial's map: a run repeats itself, what is stored is whole, the rule classes as `results/DIAL.md` says."""

import dataclasses
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from inbounds.cli import main
from inbounds.learning.storage.parquet import parquet_bytes, read_table
from inbounds.learning.storage.whole_files import DamagedFileError, held
from inbounds.study.dial import running
from inbounds.study.dial.cells import FRACTIONS, POLICIES, SEEDS, DialCell, dial_cells
from inbounds.study.dial.outcomes import (
    COMPARISONS,
    ENDPOINTS,
    MARGIN,
    DialOutcomes,
    constant_guess,
    kind_of,
    predicted_kind,
    score_of,
    settings,
    tally,
)
from inbounds.study.dial.running import DialFolder, run_cell, run_cells, wrong_cells
from inbounds.study.dial.theory import MODELS, Rates, predicted_curve

ROOT = Path(__file__).parents[3]
PLAN = (ROOT / "results" / "DIAL.md").read_text(encoding="utf8")
PILOT_SEEDS = range(900, 905)
SMALL = tuple(DialCell(policy, 0.5, seeds=(900, 901), epochs=2) for policy in POLICIES)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DialFolder:
    monkeypatch.setattr(running, "dial_cells", lambda: SMALL)
    return DialFolder(tmp_path / "results", tmp_path / "work")


def test_a_run_is_resumed_packed_and_read(folder: DialFolder) -> None:
    lines: list[str] = []
    assert not run_cells(SMALL[:2], folder, lines.append)
    assert run_cells(SMALL, folder, lines.append)
    assert [line for line in lines if "finished before" in line] == [
        f"{i}/4 {cell.id}: finished before" for i, cell in enumerate(SMALL[:2], 1)
    ]
    table = folder.read()
    assert table.num_rows == 4 * 2 * 2
    again = run_cell(SMALL[3])
    np.testing.assert_array_equal(table["score"].to_numpy()[-4:], again["score"].to_numpy())
    folder.map_file.write_bytes(folder.map_file.read_bytes()[:-1])
    with pytest.raises(
        DamagedFileError, match=r"restore both .*or make them again \(inbounds study dial run\)"
    ):
        folder.read()
    folder.sum_file.unlink()
    with pytest.raises(DamagedFileError, match=r"checksums\.txt does not list it"):
        folder.read()
    assert run_cells(SMALL, folder)  # mends it
    assert folder.read().equals(table)


def test_two_runs_in_one_folder_are_refused_in_words(folder: DialFolder) -> None:
    folder.work.mkdir()
    with ThreadPoolExecutor(1) as other, held(folder.work):
        found = other.submit(run_cells, SMALL[:1], folder).exception()
    assert isinstance(found, BlockingIOError)
    assert (
        str(found)
        == f"another process runs in {folder.work}: wait until it is done, or choose another --work"
    )


def test_an_impossible_folder_is_found_out_before_the_first_cell(
    folder: DialFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.results.touch()
    monkeypatch.setattr(running, "run_cell", lambda cell: pytest.fail("it has begun"))
    with pytest.raises(FileExistsError):
        run_cells(SMALL[:1], folder)


@pytest.mark.parametrize("key", ["seconds", "commit"])
def test_a_cell_that_does_not_say_how_it_was_made_is_damaged(folder: DialFolder, key: str) -> None:
    run_cells(SMALL[:1], folder)
    path, about = folder.cell_file(SMALL[0]), folder.about(SMALL[0])
    del about[key]
    path.write_bytes(parquet_bytes(read_table(path), json.dumps(about)))
    with pytest.raises(
        DamagedFileError, match=f"it does not say its {key}.*delete it, and run the command again"
    ):
        folder.finished(SMALL[0])


def test_another_configuration_is_not_taken_for_the_cell(folder: DialFolder) -> None:
    run_cells(SMALL[:1], folder)
    assert folder.finished(SMALL[0])
    assert not folder.finished(dataclasses.replace(SMALL[0], seeds=(900, 902)))


def test_a_seed_alone_among_others_scores_the_same() -> None:
    """The law of lockstep holds on the dial, too."""
    first, second = (
        run_cell(DialCell("beta", 1.5, "raw", 2, seeds=seeds, epochs=1)) for seeds in ((900, 901), (902, 900))
    )
    assert first["score"][0] == second["score"][1]


def test_scores_are_those_of_the_rewards() -> None:
    """What a quiet start earns is known: −noise²/f² below nothing, within sampling error."""
    table = run_cell(DialCell("gaussian", 0.5, seeds=tuple(range(900, 910)), epochs=1))
    error = 1.2 * 0.25 / np.sqrt(2560)  # standard deviation of (u − f s)², over f²
    assert np.mean(table["score"].to_numpy()) == pytest.approx(-0.16 / 0.25, abs=6 * error / 0.25)


def test_the_rule() -> None:
    assert kind_of(-MARGIN / 2, MARGIN / 2) == kind_of(0.001, MARGIN * 0.99) == "no difference"
    assert kind_of(0.001, MARGIN * 1.01) == "above"
    assert kind_of(-0.2, -0.001) == "below"
    assert kind_of(-0.2, 0.001) == "unresolved"
    assert score_of("no difference", "above") == score_of("above", "below") == "wrong"


def test_outcomes_find_what_is_planted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Curves are the predicted ones plus a little noise: *steps* must then be right nearly everywhere."""
    rng, tables = np.random.default_rng(0), []
    for cell in dial_cells():
        curve = predicted_curve(cell)[:, None] + 1e-4 * rng.standard_normal((cell.epochs, len(SEEDS)))
        rows = curve.size
        tables.append(
            pa.table(
                {
                    "cell": [cell.id] * rows,
                    "epoch": pa.array(np.repeat(np.arange(cell.epochs), len(SEEDS)), pa.int32()),
                    "seed": pa.array(np.tile(SEEDS, cell.epochs), pa.int32()),
                    "score": pa.array(curve.ravel(), pa.float32()),
                }
            )
        )
    monkeypatch.setattr("inbounds.study.dial.outcomes.DIAL_RESAMPLES", 200)
    outcomes = DialOutcomes(pa.concat_tables(tables))
    counts = tally(outcomes.findings)
    assert len(outcomes.findings) == 10 * len(settings()) == 250
    assert counts["right"] >= 245
    assert tally(outcomes.findings, "geometry")["right"] < counts["right"]
    assert constant_guess(outcomes.findings)[1] < counts["right"]
    assert {kind_of(float(e.low), float(e.high)) for e in outcomes.cost_changes().values()} == {
        "no difference"
    }


def test_geometry_knows_no_parametrisation_and_steps_do() -> None:
    free, own = DialCell("gaussian-free", 0.5), DialCell("gaussian", 0.5)
    np.testing.assert_allclose(predicted_curve(free, "geometry"), predicted_curve(own, "geometry"))
    assert predicted_curve(free)[-1] < predicted_curve(own)[-1] - MARGIN
    # log σ of the free Gaussian has moved by the learning rate times the steps, and no farther
    least = np.exp(np.log(0.42) - 3e-4 * 40 * 39) ** 2
    assert predicted_curve(free, "steps", Rates(10.0, 1.0))[-1] < 1 - 0.8 * least / 0.25


def test_the_plan_is_the_code() -> None:
    assert f"{len(dial_cells())} cells" in PLAN
    assert "margin** is 0.05" in PLAN
    assert not set(PILOT_SEEDS) & set(SEEDS)
    assert f"Seeds {PILOT_SEEDS[0]} … {PILOT_SEEDS[-1]}" in PLAN


def prediction_table() -> str:
    """Return the predictions as a Markdown table: a row per comparison, endpoint, cost and A, a column per fraction.

    Each entry has the class under *steps*, then under *geometry alone*: + above, − below, 0 no difference.
    """
    signs = {"above": "+", "below": "−", "no difference": "0"}
    lines = ["| comparison | endpoint | cost | A | " + " | ".join(f"{f:g}" for f in FRACTIONS) + " |"]
    lines.append("|---|---|---|---|" + "---|" * len(FRACTIONS))
    knobs = list(dict.fromkeys((cell.cost, cell.dims) for cell in settings()))
    for comparison in COMPARISONS:
        for endpoint in ENDPOINTS:
            for cost, dims in knobs:
                row = [f"{comparison[0]} − {comparison[1]}", endpoint, cost, str(dims)]
                for fraction in FRACTIONS:
                    cell = DialCell("gaussian", fraction, cost, dims)
                    row.append(
                        "".join(signs[predicted_kind(cell, comparison, endpoint, m)] for m in MODELS[::-1])
                    )
                lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)


@pytest.mark.slow
def test_the_predictions_are_those_that_were_committed() -> None:
    assert prediction_table() in PLAN


@pytest.mark.slow
def test_the_shipped_map_is_repeated() -> None:
    folder = DialFolder.shipped()
    assert wrong_cells(folder, cells=[DialCell("beta", 1.5), DialCell("gaussian-free", 0.25, "raw", 8)]) == []
    assert wrong_cells(folder, cells=[DialCell("logit-normal", 0.9, "executed")], epochs=1) == []


@pytest.mark.parametrize("words", [["--epochs", "0"], ["--epochs", "41"], ["--random=-1"]], ids=str)
def test_a_check_of_nothing_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "dial", "verify", *words]) == 2
    assert "--epochs 1 to 40" in capsys.readouterr().err


def test_a_cell_or_a_checksum_that_is_cut_short_is_called_damaged(folder: DialFolder) -> None:
    folder.work.mkdir()
    folder.results.mkdir()
    folder.cell_file(SMALL[0]).write_bytes(b"")
    with pytest.raises(DamagedFileError, match="delete it, and run the command again"):
        folder.finished(SMALL[0])
    for config in ({}, None):
        about = {name: "" for name in ("seconds", "commit", "engine", "versions", "processor")} | {
            "config": config
        }
        folder.cell_file(SMALL[0]).write_bytes(parquet_bytes(pa.table({}), json.dumps(about)))
        with pytest.raises(DamagedFileError, match="delete it, and run the command again"):
            folder.finished(SMALL[0])
    folder.map_file.write_bytes(b"PAR1")
    folder.sum_file.write_text("")
    with pytest.raises(DamagedFileError, match="git checkout"):
        folder.read()
