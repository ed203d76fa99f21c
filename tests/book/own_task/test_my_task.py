"""The template runs as it is handed out, tells its rows, and refuses an environment that a check stops."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.own_task import my_task
from inbounds.learning import load_policy


def test_it_runs_as_a_file_in_another_folder(tmp_path: Path) -> None:
    copy = tmp_path / "my_task.py"
    copy.write_text(Path(my_task.__file__).read_text(encoding="utf8"), encoding="utf8")
    done = subprocess.run(
        [sys.executable, copy, "--seeds", "2", "--epochs", "2", "--policy", "beta", "--out", "run"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    rows = done.stdout.splitlines()
    assert len(rows) == 6
    number = r"[+-]?\d+\.\d"
    assert re.fullmatch(
        rf"beta, greedy +{number} \[{number}, {number}\]   {number} \[{number}, {number}\]", rows[4]
    )
    assert [row[:12].strip() for row in rows[1:3]] == ["nothing", "constant 1.5"]
    assert 0 <= load_policy(tmp_path / "run").act(np.zeros(my_task.SEEN), greedy="median") <= 3


def test_the_rule_is_not_at_the_end_of_what_is_tried() -> None:
    name, _ = my_task.best_of(my_task.RULES, my_task.make_envs, my_task.CHOSEN_BY)
    assert name not in (next(iter(my_task.RULES)), list(my_task.RULES)[-1])


def test_an_unsound_task_is_stopped_by_its_check(monkeypatch: pytest.MonkeyPatch) -> None:
    step = my_task.MyTask.step

    monkeypatch.setattr(my_task.MyTask, "step", lambda self, action: step(self, np.minimum(action, 1)))
    with pytest.raises(SystemExit, match="bounds"):
        my_task.main(["--seeds", "2", "--epochs", "1"])


@pytest.mark.parametrize(
    ("words", "said"),
    [("--seeds 1", "an interval needs two at least"), ("--policy normal", "invalid choice")],
)
def test_what_could_only_fail_after_training_is_refused_before(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        my_task.main(words.split())
    assert said in capsys.readouterr().err


def test_no_day_serves_twice() -> None:
    assert not set(my_task.CHOSEN_BY) & set(my_task.TESTED)
    assert np.isclose(my_task.LOW[0], 0)
