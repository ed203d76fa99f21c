"""The README is short, its findings are the data's, its snippet runs, its picture and its links are there."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.report import answers, study_pages, ways_to_act
from inbounds.book.report.equal_start import laws, outcomes_of_both, quiet_starts
from inbounds.learning import load_policy
from inbounds.study import grid
from inbounds.study.outcomes import Outcomes
from inbounds.study.words import spoken
from tools import readme_picture

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf8")
BULLETS = re.findall(r"^- \*\*.*?(?=^- |^$)", TEXT, re.MULTILINE | re.DOTALL)


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
    assert {row.study for row in ppo} == {2}
    assert sorted(map(answers.sign, ppo)) == [-1, -1, 0, 0, 1, 1]
    (cheetah,), (humanoid,) = (answers.of(ppo, robot=robot) for robot in ("HalfCheetah", "Humanoid"))
    assert f"on 2 of 6 robots under PPO (HalfCheetah: by {spoken(cheetah.difference, 0)})" in said
    loss = humanoid.difference
    lost = replace(loss, value=-loss.value, low=-loss.high, high=-loss.low)
    assert f", lower on 2 (Humanoid: by {spoken(lost, 0)});" in said
    trpo = answers.of(final, algorithm="trpo")
    assert [answers.sign(row) for row in trpo] == [1, 1]
    assert said.endswith("under TRPO higher on 2 of 2.")
    assert answers.start_advice(ppo) != answers.start_advice(final)


def test_a_law(outcomes: Outcomes) -> None:
    both = outcomes_of_both(outcomes)
    every = laws(both)
    for algorithm in ("ppo", "trpo"):
        assert answers.advice(every, algorithm).endswith(" no law leads: keep your library's law.")
    said = bullet("Then keep your library's law.")

    def counts(law: str, endpoint: str) -> tuple[int, int]:
        rows = answers.of(every, algorithm="ppo", law=law, endpoint=endpoint)
        assert [row.study for row in rows] == [2] * 6
        above, below = answers.sides(rows)
        return len(above), len(below)

    assert (counts("beta", "final"), counts("beta", "area")) == ((2, 0), (2, 1))
    assert (
        "no law is better throughout: PPO's Beta is higher on 2 of 6 robots, faster on 2 and slower on 1;"
        in said
    )
    assert (counts("logit-normal", "final"), counts("logit-normal", "area")) == ((0, 1), (1, 2))
    assert said.endswith("a logit-normal is lower on 1, faster on 1 and slower on 2.")


def test_the_median() -> None:
    shipped = study_pages.shipped()
    fresh = Outcomes.read(shipped.folder, grid.second_cells())
    noise, fresh_noise = (ways_to_act.count(ways_to_act.rows_of(each), "sample") for each in (shipped, fresh))
    said = bullet("Act by the median")
    assert not noise.above + fresh_noise.above
    assert f"in {noise.below + fresh_noise.below} of the {noise.cells + fresh_noise.cells} cells" in said
    assert said.endswith("of both studies, and less in none.")


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
