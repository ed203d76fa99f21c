"""No worker is left with a long file at the end."""

from pathlib import Path
from types import SimpleNamespace

from tests.longest_first import FIRST, pytest_collection_modifyitems


def test_files_are_taken_up_longest_first() -> None:
    files = {"a.py": "..", "b.py": "...", "c.py": ".s", "d.ipynb": "..", "e.ipynb": "....", "f.py": ".."}
    files["test_compiled.py"] = "."
    items = [
        SimpleNamespace(
            name=f"{file}{i}", path=Path(file), get_closest_marker=lambda _, kind=kind: kind == "s"
        )
        for file, kinds in files.items()
        for i, kind in enumerate(kinds)
    ]
    pytest_collection_modifyitems(items)
    assert list(dict.fromkeys(item.path.name for item in items)) == [
        "test_compiled.py",
        *("e.ipynb", "d.ipynb"),  # notebooks
        "c.py",  # with a slow test
        *("b.py", "a.py", "f.py"),
    ]
    assert [item.name for item in items if item.path.name == "b.py"] == ["b.py0", "b.py1", "b.py2"]


def test_what_comes_first_is_there() -> None:
    tests = Path(__file__).parent
    assert [len(list(tests.rglob(name))) for name in FIRST] == [1]
