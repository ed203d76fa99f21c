"""The comparison of the two engines trains both, judges, and is not run twice."""

import json
from pathlib import Path

import pytest

from benchmarks import engines, published


def test_a_small_comparison_judges_and_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [
        "--envs",
        "Swimmer-v5",
        "--seeds",
        "2",
        "--epochs",
        "2",
        "--horizon",
        "1024",
        "--output",
        str(tmp_path),
    ]
    engines.main(words)
    said = capsys.readouterr().out
    assert said.startswith("Swimmer-v5: ")
    folder = tmp_path / "ppo-logit-normal"
    verdict = json.loads((folder / "engines.json").read_text())["verdicts"]["Swimmer-v5"]
    assert {who: len(verdict[who]) for who in (engines.ORACLE, engines.NEW)} == {"autograd": 2, "compiled": 2}
    assert verdict["autograd"] != verdict["compiled"]
    monkeypatch.setattr(engines, "train_side", lambda *_: pytest.fail("everything is there"))
    engines.main(words)
    assert capsys.readouterr().out == said


def test_a_small_comparison_does_not_replace_what_is_stored(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the command that the help gives as a small one, and by the default; nothing is trained."""
    monkeypatch.setattr(published, "RESULTS", tmp_path)
    monkeypatch.setattr(engines, "train_side", lambda *_: None)
    monkeypatch.setattr(engines, "judge", lambda *_: {"undecided": "made up"})
    folder = tmp_path / "engines" / "ppo-logit-normal"
    folder.mkdir(parents=True)
    stored = (engines.RESULTS / "engines" / folder.name / "engines.json").read_text()
    (folder / "engines.json").write_text(stored)
    output = ["--output", str(tmp_path / "engines")]
    for words in (["--envs", "Swimmer-v5", "--epochs", "30"], [], ["--margin", "0.2", "--seeds", "40"]):
        engines.main([*words, *output])
        assert (folder / "engines.json").read_text() == stored
        aside = tmp_path / "some" / "engines" / folder.name / "engines.json"
        assert "made up" in aside.read_text()
        aside.unlink()
        assert "Results go to" in capsys.readouterr().out
    engines.main(["--envs", "Hopper-v5", "--seeds", "40", *output])  # as the notebook says
    assert (
        json.loads((folder / "engines.json").read_text())["verdicts"]["Hopper-v5"]["undecided"] == "made up"
    )
    assert "Results go to" not in capsys.readouterr().out


def test_a_verdict_is_the_equivalence_of_the_areas() -> None:
    found = {"equivalent": False, "ratio": 0.9, "low": 0.8, "high": 1.0, "p_value": 0.2, "seeds_needed": 40}
    said = engines.in_words("Hopper-v5", found, 0.15)
    assert "not shown to be equivalent within ± 15%" in said
    assert "40 seeds a side" in said
