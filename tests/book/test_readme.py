"""The README's findings are the data's: each number and each verdict is computed again."""

import re
from pathlib import Path

import nbformat
import pytest

from inbounds.book.report import study_pages
from inbounds.study import grid
from inbounds.study.analysis import Contrast, change, differences, improvement
from inbounds.study.outcomes import Outcomes
from inbounds.study.words import spoken, verdict

ROOT = Path(__file__).resolve().parents[2]
BULLETS = re.findall(
    r"^- \*\*.*?(?=^- |^$)", (ROOT / "README.md").read_text(encoding="utf8"), re.MULTILINE | re.DOTALL
)
PPO_BETA = Contrast("standard", "ppo", "beta", "gaussian")
PPO_LOGIT = Contrast("standard", "ppo", "logit-normal", "gaussian")
TRPO_LOGIT = Contrast("standard", "trpo", "logit-normal", "gaussian")


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    return study_pages.shipped().and_of(grid.AFTERWARDS)


def bullet(words: str) -> str:
    """The one bullet that has these words, on one line."""
    (found,) = [" ".join(each.split()) for each in BULLETS if words in " ".join(each.split())]
    return found


def counts(outcomes: Outcomes, contrast: Contrast) -> tuple[int, int]:
    """On how many robots the first ends higher, and lower."""
    told = [verdict(each) for each in differences(outcomes, contrast, "final").values()]
    assert len(told) == 6
    return told.count("higher"), told.count("lower")


def lead(outcomes: Outcomes, contrast: Contrast, robot: str) -> str:
    return spoken(differences(outcomes, contrast, "final")[robot].difference, 0)


def changed(outcomes: Outcomes, cell: str) -> str:
    return spoken(change(outcomes, outcomes.finished[cell], "final"), 0)


def glued(notebook: str) -> dict[str, str]:
    """The values that a stored notebook glues, by name."""
    cells = nbformat.read(ROOT / "notebooks" / f"{notebook}.ipynb", as_version=4).cells
    outputs = [output for cell in cells if cell.cell_type == "code" for output in cell.outputs]
    return {
        output.metadata["scrapbook"]["name"]: next(iter(output.data.values()))
        for output in outputs
        if "scrapbook" in output.get("metadata", {})
    }


def test_no_bullet_is_long() -> None:
    assert BULLETS
    for each in BULLETS:
        assert len(each.strip().splitlines()) <= 2, each


def test_who_ends_higher(outcomes: Outcomes) -> None:
    assert [counts(outcomes, c) for c in (PPO_BETA, PPO_LOGIT, TRPO_LOGIT)] == [(4, 0), (3, 0), (3, 1)]
    said = bullet("often end higher")
    assert "on 4 of 6 robots, the logit-normal on 3, neither below it on any" in said
    assert "above it on 3 and below it on 1 (Walker2d)" in said
    assert verdict(differences(outcomes, TRPO_LOGIT, "final")["Walker2d"]) == "lower"
    between = improvement(outcomes, Contrast("standard", "ppo", "logit-normal", "beta"), "final")
    assert between is not None
    assert between.high < 0.5
    assert f"probability {spoken(between, 2)}" in bullet("Beta does best")


def test_quiet_starts(outcomes: Outcomes) -> None:
    said = bullet("Start quietly")
    assert f"leads by {lead(outcomes, TRPO_LOGIT, 'HalfCheetah')}" in said
    for robot in ("halfcheetah", "ant"):
        assert f"gains {changed(outcomes, f'afterwards-{robot}-trpo-gaussian-matched-noise')}" in said
    ant = outcomes.finished["afterwards-ant-trpo-gaussian-matched-noise"]
    gained, led = change(outcomes, ant, "final"), differences(outcomes, TRPO_LOGIT, "final")["Ant"].difference
    assert gained is not None
    assert led is not None
    assert abs(gained.value / led.value - 1) < 0.1  # "about"
    said = bullet("not everything")
    assert f"by {changed(outcomes, 'afterwards-humanoid-ppo-gaussian-matched-noise')}" in said
    assert f"leads by {lead(outcomes, PPO_BETA, 'Humanoid')}" in said


def test_what_robots_do(outcomes: Outcomes) -> None:
    seen = glued("inside_the_policies")
    said = bullet("Look at the robot")
    assert f"{seen['moves-loud']} of {seen['seeds-loud']} policies" in said
    assert f"{seen['moves-quiet']} of {seen['seeds-quiet']} that began quiet" in said
    said = bullet("Mind the discount")
    columns = [(a, f) for a in ("ppo", "trpo") for f in ("gaussian", "beta", "logit-normal")]
    cells = [outcomes.finished[f"mechanisms-swimmer-{a}-{f}-gamma-0.9999"] for a, f in columns]
    raised = [each for cell in cells if (each := change(outcomes, cell, "final")) is not None]
    assert len(raised) == len(cells)
    assert min(each.low for each in raised) > 0
    least, most = (choose(raised, key=lambda each: each.value) for choose in (min, max))
    assert f"by {spoken(least, 0)} to {spoken(most, 0)}" in said
    assert f"{seen['swim-folded-seeds']} of {seen['swim-seeds-0.9999']} still do" in said
    assert f"all {seen['swim-seeds-0.99']} seeds fold" in said


def test_capg_and_the_beta_under_trpo(outcomes: Outcomes) -> None:
    said = bullet("CAPG")
    for algorithm in ("ppo", "trpo"):
        contrast = Contrast("beyond", algorithm, "clipped-gaussian", "gaussian")
        assert f"{lead(outcomes, contrast, 'HalfCheetah')} under {algorithm.upper()}" in said
        assert verdict(differences(outcomes, contrast, "final")["HalfCheetah"]) == "unresolved"
    beta = Contrast("beyond", "trpo", "beta", "gaussian")
    assert f"{lead(outcomes, beta, 'HalfCheetah')} above the Gaussian" in bullet("TRPO works with a Beta")


def test_the_thesis_s_settings(outcomes: Outcomes) -> None:
    """With the printed settings the logit-normal ends above the Gaussian on HalfCheetah and not on Swimmer."""
    for algorithm in ("ppo", "trpo"):
        found = differences(outcomes, Contrast("printed", algorithm, "logit-normal", "gaussian"), "final")
        assert verdict(found["HalfCheetah"]) == "higher"
        assert verdict(found["Swimmer"]) != "higher"
