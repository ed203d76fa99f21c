"""The README is short, its findings are the data's, its snippet runs, its picture and its links are there."""

import re
from collections import Counter
from pathlib import Path

import pytest

from inbounds.book.report import answers, study_pages, ways_to_act
from inbounds.book.report.equal_start import grade, laws, outcomes_of_both
from inbounds.study import grid
from inbounds.study.analysis import Contrast, change, differences
from inbounds.study.outcomes import Outcomes
from inbounds.study.words import spoken
from tools import readme_picture

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf8")
BULLETS = re.findall(r"^- \*\*.*?(?=^- |^$)", TEXT, re.MULTILINE | re.DOTALL)
PPO_BETA = Contrast("standard", "ppo", "beta", "gaussian")


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return study_pages.shipped().and_of(grid.AFTERWARDS)


def bullet(words: str) -> str:
    """The one bullet that has these words, on one line."""
    (found,) = [" ".join(each.split()) for each in BULLETS if words in " ".join(each.split())]
    return found


def lead(outcomes: Outcomes, robot: str) -> str:
    return spoken(differences(outcomes, PPO_BETA, "final")[robot].difference, 0)


def test_it_is_short() -> None:
    assert len(BULLETS) == 3
    for each in BULLETS:
        assert len(each.strip().splitlines()) <= 2, each
    assert len(TEXT.splitlines()) <= 60


def test_quiet_starts(outcomes: Outcomes) -> None:
    said = bullet("Start quietly")
    gained = change(outcomes, outcomes.finished["mechanisms-halfcheetah-ppo-gaussian-matched-noise"], "final")
    assert gained is not None
    assert gained.low > 0
    assert f"gains {spoken(gained, 0)} points" in said
    assert f"is {lead(outcomes, 'HalfCheetah')}." in said


def test_a_law(outcomes: Outcomes) -> None:
    rows = answers.of(laws(outcomes_of_both(outcomes)), algorithm="ppo")
    assert (
        answers.advice("ppo", answers.first_choice(rows)) == "Under PPO, take the law that your library has."
    )
    said = bullet("Then take the law that your library has.")
    final, area = (answers.of(rows, law="beta", endpoint=e) for e in ("final", "area"))
    assert all(row.study == 2 for row in (*final, *area))
    above, below = (Counter(grade(row) for row in final if answers.sign(row) == way) for way in (1, -1))
    assert above == {"found with fresh seeds": 1, "suggested": 1}
    assert "above a Gaussian on 2 of 6 robots (found on 1, suggested on 1) and below it on none" in said
    assert not below
    assert [grade(row) for row in area if answers.sign(row) < 0] == ["suggested"]
    assert "its learning curve lies lower on 1 (suggested)" in said


def test_the_median() -> None:
    mode = ways_to_act.count(ways_to_act.rows_of(study_pages.shipped()), "mode")
    said = bullet("Act by the median")
    assert f"less than its median in {mode.below} of {mode.cells} cells, and more in {mode.above}." in said


def test_the_snippet_runs() -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert "seeds=10, epochs=2)" in snippet
    names: dict[str, object] = {}
    exec(snippet.replace("seeds=10, epochs=2)", "seeds=1, epochs=1)"), names)
    assert all(abs(each) <= 1 for each in names["action"])  # type: ignore[attr-defined]


def test_every_link_leads_to_a_file() -> None:
    for page in ("README.md", "INSTALL.md", "benchmarks/README.md"):
        path = ROOT / page
        for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", path.read_text(encoding="utf8")):
            assert (path.parent / target).exists(), (page, target)


def test_the_picture_is_the_drawing() -> None:
    assert readme_picture.TARGET.read_text(encoding="utf8") == readme_picture.drawing()
    assert readme_picture.TARGET.stat().st_size < 10_000
    assert "three_laws.svg" in TEXT
