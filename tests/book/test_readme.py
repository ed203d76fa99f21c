"""The README is short, its findings are the data's, its snippet runs, its picture and its links are there."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.report import answers, secondary_tests, study_pages, ways_to_act
from inbounds.book.report.equal_start import grade, laws, outcomes_of_both, quiet_starts
from inbounds.learning import load_policy
from inbounds.study import grid
from inbounds.study.analysis import Contrast
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


def test_it_is_short() -> None:
    assert len(BULLETS) == 3
    for each in BULLETS:
        assert len(each.strip().splitlines()) <= 2, each
    assert len(TEXT.splitlines()) <= 60


def test_quiet_starts(outcomes: Outcomes) -> None:
    final = answers.of(quiet_starts(outcomes_of_both(outcomes)), endpoint="final")
    said = bullet(answers.start_advice(final))
    ppo = answers.of(final, algorithm="ppo")
    above, below = answers.sides(ppo)
    assert {row.study for row in ppo} == {2}
    assert {grade(row) for row in above} == {"found"}
    assert sorted(grade(row) for row in below) == ["found", "suggested"]
    assert len(above) == 2
    assert f"PPO's quiet Gaussian ends above one with σ = 1 on 2 of {len(ppo)} robots (found)" in said
    assert "below on 2 (1 of them found), by area above on 2 (found), below on 1;" in said
    sides = answers.sides(
        answers.of(quiet_starts(outcomes_of_both(outcomes)), algorithm="ppo", endpoint="area")
    )
    assert [[grade(row) for row in side] for side in sides] == [["found", "found"], ["suggested"]]
    (cheetah,) = answers.of(above, robot="HalfCheetah")
    assert f"on HalfCheetah by {spoken(cheetah.difference, 0)}," in said
    trpo = answers.of(final, algorithm="trpo")
    assert [(row.robot, grade(row)) for row in trpo] == [("HalfCheetah", "suggested"), ("Ant", "suggested")]
    assert len(answers.sides(trpo)[0]) == 2
    assert "under TRPO above on 2 of 2." in said
    assert answers.start_advice(ppo) != answers.start_advice(final)


def test_a_law(outcomes: Outcomes) -> None:
    every = laws(outcomes_of_both(outcomes))
    for algorithm in ("ppo", "trpo"):
        assert answers.advice(every, algorithm).endswith(" no law leads: keep your library's law.")
    rows = answers.of(every, algorithm="ppo")
    said = bullet("Then keep your library's law.")
    graded = {
        (law, endpoint, way): Counter(grade(row) for row in here if answers.sign(row) == way)
        for law in ("beta", "logit-normal")
        for endpoint in ("final", "area")
        for here in [answers.of(rows, law=law, endpoint=endpoint)]
        for way in (1, -1)
    }
    assert all(row.study == 2 for row in rows)
    assert graded["beta", "final", 1] == {"found": 2}
    assert not graded["beta", "final", -1]
    assert graded["beta", "area", 1] == {"found": 1, "suggested": 1}
    assert graded["beta", "area", -1] == {"suggested": 1}
    small = [row for row in answers.of(rows, law="beta", endpoint="area") if answers.too_small(row)]
    assert sum(row.difference.high < 0 for row in small) == 2
    assert (
        "PPO's Beta ends above on 2 of 6 robots (found), by area above on 2 and below on 3 (2 by too little);"
        in said
    )
    assert not graded["logit-normal", "final", 1]
    assert graded["logit-normal", "final", -1] == {"found": 1}
    assert graded["logit-normal", "area", 1] == {"found": 1}
    assert graded["logit-normal", "area", -1] == {"found": 2}
    alike, by_area = (
        secondary_tests.verdicts(outcomes_of_both(outcomes), "law, σ free", "logit-normal", endpoint)
        for endpoint in ("final", "area")
    )
    assert alike.startswith("above on 2 of 6 robots")
    assert "below" not in alike
    assert "), below on 1 (" in by_area
    assert "a logit-normal below on 1, with a Gaussian's kind of σ above on 2, by area below on 1." in said


def test_the_median() -> None:
    shipped = study_pages.shipped()
    fresh = Outcomes.read(shipped.folder, grid.second_cells())
    noise, fresh_noise = (ways_to_act.count(ways_to_act.rows_of(each), "sample") for each in (shipped, fresh))
    said = bullet("Act by the median")
    assert not noise.above + fresh_noise.above
    count = f"{noise.below} of the first study's {noise.cells} cells"
    assert f"a Beta or logit-normal earns less than by its median in {count}" in said
    assert f"{fresh_noise.below} of the second's {fresh_noise.cells}, more in none (suggested)." in said


def test_the_snippet_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (snippet,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert "seeds=10, epochs=2)" in snippet
    names: dict[str, object] = {}
    exec(snippet.replace("seeds=10, epochs=2)", "seeds=1, epochs=1)"), names)
    assert all(abs(each) <= 1 for each in names["action"])  # type: ignore[attr-defined]
    assert np.array_equal(load_policy("run").act([0.0] * 17, greedy="median"), names["action"])  # type: ignore[arg-type]


def test_every_link_leads_to_a_file() -> None:
    for page in ("README.md", "INSTALL.md", "benchmarks/README.md"):
        path = ROOT / page
        for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", path.read_text(encoding="utf8")):
            assert (path.parent / target).exists(), (page, target)


def test_the_picture_is_the_drawing() -> None:
    assert readme_picture.TARGET.read_text(encoding="utf8") == readme_picture.drawing()
    assert readme_picture.TARGET.stat().st_size < 10_000
    assert "three_laws.svg" in TEXT


def test_the_speeds_of_the_benchmarks_page_are_those_measured() -> None:
    table = (ROOT / "benchmarks" / "results" / "speed.md").read_text(encoding="utf8")
    page = " ".join((ROOT / "benchmarks" / "README.md").read_text(encoding="utf8").split())

    def over_peer(robot: str, who: str) -> float:
        section = table.partition(f"\n## {robot}-v5\n")[2].partition("\n## ")[0]
        (row,) = [line for line in section.splitlines() if line.startswith(f"| {who} |")]
        return float(row.split("|")[3].split()[0])

    cheetah, hopper, ant, humanoid, trpo = (
        [over_peer(robot, f"In Bounds {algorithm}, S = {seeds}") for seeds in (10, 1)]
        for robot, algorithm in (
            ("HalfCheetah", "PPO"),
            ("Hopper", "PPO"),
            ("Ant", "PPO"),
            ("Humanoid", "PPO"),
            ("Hopper", "TRPO"),
        )
    )
    assert (
        f": {cheetah[0]:.1f} on HalfCheetah, {hopper[0]:.1f} on Hopper, {ant[0]:.1f} on Ant, {humanoid[0]:.1f} on "
        f"Humanoid (PPO), and {trpo[0]:.1f} on Hopper under TRPO."
    ) in page
    assert (
        f": {cheetah[1]:.2f}, {hopper[1]:.2f}, {ant[1]:.2f} and {humanoid[1]:.2f} (PPO), and {trpo[1]:.2f} on Hopper "
        "under TRPO."
    ) in page
