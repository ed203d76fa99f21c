"""`inbounds grade`: what graders say of students' notebooks, each run in a process of its own, within its limits."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest

from inbounds.cli.classroom import grading
from tests.cli.small import run, succeeds

IMPORTS = "import time\nfrom inbounds.book.exercises import storing_actions as graders"
RIGHT = "import math\ndef bits_for(z):\n    return math.ceil(math.log2(1 + math.exp(z)) - 2)"
WRONG = "import math\ndef bits_for(z):\n    return math.ceil(math.log2(1 + math.exp(z)))"
CALL = "graders.bits_for(bits_for)"


def notebook(path: Path, *cells: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    made = [nbformat.v4.new_markdown_cell("# Mine"), *map(nbformat.v4.new_code_cell, cells)]
    nbformat.write(nbformat.v4.new_notebook(cells=made), path)
    return path


def graded(path: Path, seconds: float = 60, gigabytes: float = 6) -> list[tuple[str, str, str]]:
    return [(g.exercise, g.mark, g.message) for g in grading.grade(path, seconds, gigabytes)]


@pytest.mark.slow
def test_a_class_is_graded(tmp_path: Path) -> None:
    notebook(tmp_path / "ada" / "08.ipynb", IMPORTS, RIGHT, CALL)
    notebook(tmp_path / "ben" / "08.ipynb", IMPORTS, "raise OSError('a cell that fails')", WRONG, CALL)
    notebook(tmp_path / "cy" / "08.ipynb", IMPORTS, "def bits_for(z):\n    return ...", CALL)
    table = tmp_path / "grades.csv"
    out = succeeds(["grade", str(tmp_path), "--out", str(table)])
    with table.open(encoding="utf8") as file:
        rows = list(csv.DictReader(file))
    assert [(Path(row["notebook"]).parent.name, row["exercise"], row["mark"]) for row in rows] == [
        ("ada", "bits_for", "passed"),
        ("ben", "bits_for", "not yet"),
        ("cy", "bits_for", "not answered"),
    ]
    assert rows[1]["message"].startswith("two bits too many")
    assert "1 of 3 exercises passed, in 3 notebooks" in out


@pytest.mark.slow
def test_what_was_said_before_the_time_was_over_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = tmp_path / "mark"
    lasting = f"open({str(mark)!r}, 'w').close()\ntime.sleep(600)"
    path = notebook(tmp_path / "slow.ipynb", IMPORTS, RIGHT, CALL, lasting, CALL)

    class Hurried(subprocess.Popen):
        """Its time is over when the notebook has come to its long cell, on a slow machine too."""

        def wait(self, timeout: float | None = None) -> int:
            if timeout is None:
                return super().wait()
            assert timeout == 20
            while not mark.exists():
                assert self.poll() is None
                time.sleep(0.1)
            return super().wait(0.1)

    monkeypatch.setattr(subprocess, "Popen", Hurried)
    (_, first, _), (_, second, why) = graded(path, seconds=20)
    assert (first, second) == ("passed", "not reached")
    assert why == "not reached within 20 s (--seconds)"


@pytest.mark.slow
def test_memory_and_exits_are_a_students_own(tmp_path: Path) -> None:
    greedy = notebook(tmp_path / "greedy.ipynb", IMPORTS, RIGHT, "x = bytearray(8_000_000_000)", CALL)
    assert graded(greedy, gigabytes=4)[0][1] == "passed"  # the cell raised MemoryError, the others ran
    gone = notebook(tmp_path / "gone.ipynb", IMPORTS, RIGHT, "import os; os._exit(3)", CALL)
    ((_, mark, why),) = graded(gone)
    assert mark == "not reached"
    assert "ended with code 3" in why


@pytest.mark.skipif(sys.platform != "linux", reason="sets a limit of Linux")
@pytest.mark.parametrize("hard", [5, 7], ids=["below --gigabytes", "above"])
def test_a_limit_that_the_shell_has_set_is_not_raised(hard: int) -> None:
    """As `ulimit -d` does, for whatever the shell starts."""
    script = (
        "from resource import RLIMIT_DATA, getrlimit, setrlimit\n"
        "from inbounds.cli.classroom.student import limit_memory\n"
        f"setrlimit(RLIMIT_DATA, 2 * ({hard}_000_000_000,))\n"
        "limit_memory(6)\n"
        "print(*getrlimit(RLIMIT_DATA))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout.split() == 2 * [str(min(6, hard) * 10**9)], done.stderr


@pytest.mark.slow
def test_every_mark_is_that_of_its_own_exercise(tmp_path: Path) -> None:
    """A cell that raises, or calls a grader without showing it, moves no other exercise's mark."""
    hidden = "print(graders.bits_for(bits_for).message)"
    path = notebook(tmp_path / "a.ipynb", IMPORTS, RIGHT, "graders.bits_for(undefined)", hidden, CALL)
    rows = graded(path)
    assert [row[:2] for row in rows] == [("bits_for", "not reached"), ("bits_for", "passed")]
    assert "the grader's cell raised an error" in rows[0][2]


def test_files_that_are_no_such_notebook(tmp_path: Path) -> None:
    text = tmp_path / "a.ipynb"
    for written in ("{", "[" * 100_000):
        text.write_text(written, encoding="utf8")
        assert graded(text) == [("–", "not reached", "this file is no notebook: ask for it again")]
    other = notebook(tmp_path / "b.ipynb", "1 + 1")
    assert "calls no grader" in graded(other)[0][2]


@pytest.mark.slow
def test_a_students_words_do_no_harm(tmp_path: Path) -> None:
    """A line's end, a separator of lines, and half of a pair of surrogates."""
    said = ("caf\x85e", "one\u2028two", "a\udc80b")
    raising = [f"def bits_for(z):\n    raise ValueError({each!r})" for each in said]
    cells = [cell for each in (*raising, RIGHT) for cell in (each, CALL)]
    marks = [row[1] for row in graded(notebook(tmp_path / "a.ipynb", IMPORTS, *cells))]
    assert marks == ["not yet", "not yet", "not yet", "passed"]


def test_a_file_that_cannot_be_read_is_one_students(tmp_path: Path) -> None:
    (tmp_path / "a.ipynb").symlink_to("/nowhere")
    ((_, mark, why),) = graded(tmp_path / "a.ipynb")
    assert (mark, why[:29]) == ("not reached", "this file cannot be read (No ")


@pytest.mark.parametrize("signal_sent", [signal.SIGINT, signal.SIGTERM])
def test_what_was_graded_before_an_interruption_is_kept(
    signal_sent: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in "abc":
        notebook(tmp_path / f"{name}.ipynb", CALL)
    out = tmp_path / "grades.csv"
    out.write_text("of last week", encoding="utf8")

    def grade(path: Path, *_: float) -> list[grading.Grade]:
        if path.stem == "b":
            signal.raise_signal(signal_sent)
        return [grading.Grade(path, "bits_for", "passed", "")]

    monkeypatch.setattr(grading, "grade", grade)
    before = signal.getsignal(signal.SIGTERM)
    ours = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background ignores it
    try:
        code, said, _ = run("grade", tmp_path, "--out", out)
    finally:
        signal.signal(signal.SIGINT, ours)
    assert code == 130
    assert "1 of 1 exercises passed" in said
    assert out.read_text(encoding="utf8") == "of last week"
    assert len((tmp_path / "grades.partial.csv").read_text(encoding="utf8").splitlines()) == 2
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.slow
def test_the_end_of_grading_is_the_end_of_the_students_process(tmp_path: Path) -> None:
    mark = tmp_path / "pid"
    cell = f"import os\nopen({str(mark)!r}, 'w').write(str(os.getpid()))\ntime.sleep(600)"
    path = notebook(tmp_path / "a.ipynb", IMPORTS, cell, RIGHT, CALL)
    process = subprocess.Popen(
        [sys.executable, "-c", f"from inbounds.cli import main; main(['grade', {str(path)!r}])"]
    )
    while not mark.exists() or not mark.read_text(encoding="utf8"):
        assert process.poll() is None
        time.sleep(0.1)
    process.terminate()
    process.wait(30)
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text(encoding="utf8")), 0)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="looks at a process in /proc")
def test_what_a_notebook_started_ends_with_it(tmp_path: Path) -> None:
    mark = tmp_path / "pid"
    cell = (
        "import subprocess\nchild = subprocess.Popen(['sleep', '600'])\n"
        f"open({str(mark)!r}, 'w').write(str(child.pid))"
    )
    assert graded(notebook(tmp_path / "a.ipynb", IMPORTS, cell, RIGHT, CALL))[0][1] == "passed"
    state = Path(f"/proc/{mark.read_text(encoding='utf8')}/stat")
    for _ in range(1000):  # a killed process goes in its own time
        if not state.exists() or state.read_text(encoding="utf8").split()[2] == "Z":
            break
        time.sleep(0.01)
    else:
        pytest.fail("the child of a notebook outlives it")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["nowhere"], "there is no nowhere: name a notebook, or a folder of notebooks"),
        ([".", "--seconds", "0"], "--seconds and --gigabytes must be positive numbers"),
        ([".", "--seconds", "nan"], "--seconds and --gigabytes must be positive numbers"),
        ([".", "--gigabytes", "inf"], "--seconds and --gigabytes must be positive numbers"),
        ([".", "--out", "."], ". cannot be written: choose another --out"),
        ([".", "--out", "no/folder/a.csv"], "there is no folder no/folder for the CSV"),
        (["."], "has no notebook in it"),
        ([], "name a notebook, or a folder of them"),
    ],
)
def test_what_cannot_be_graded_is_said(
    args, message, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("grade", *args)
    assert code in (1, 2)
    assert out == ""
    assert message in err
