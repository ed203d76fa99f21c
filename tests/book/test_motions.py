"""What is kept of the robots' motions is what the shipped policies do, and the page reads it instead of playing."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from inbounds.book import motions
from inbounds.book.report.over_seeds import final_policies
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import StudyFolder, store
from inbounds.study.grid import AFTERWARDS
from inbounds.study.outcomes import Outcomes
from tests.book.anatomy import ROOT, cells_of

SHIPPED = StudyFolder(ROOT / "results", ROOT / "runs" / "study")


@pytest.fixture(scope="module")
def kept() -> dict[str, np.ndarray]:
    return motions.read(SHIPPED)


def test_the_policies_that_were_played_are_those_that_are_shipped() -> None:
    sums = motions.about(SHIPPED)["policies"]
    outcomes = Outcomes.read(SHIPPED).and_of(AFTERWARDS)
    for name, expected in sums.items():
        (policies, *_) = SHIPPED.policy_files(outcomes.finished[name].cell)
        assert store.sha256(policies) == expected, f"{name}: python -m inbounds.book.motions"


def test_a_changed_file_is_not_read(tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path, tmp_path / "runs")
    shutil.copy(SHIPPED.results / store.CHECKSUMS_FILE, tmp_path)
    (tmp_path / "policies").symlink_to(SHIPPED.results / "policies")
    data = bytearray(motions.motions_file(SHIPPED).read_bytes())
    motions.motions_file(folder).write_bytes(data)
    assert motions.read(folder).keys() == motions.read(SHIPPED).keys()
    data[-1] ^= 1
    motions.motions_file(folder).write_bytes(data)
    with pytest.raises(
        DamagedFileError, match=r"is not what checksums\.txt lists\): restore it .*inbounds\.book\.motions"
    ):
        motions.read(folder)
    motions.motions_file(folder).unlink()
    with pytest.raises(
        FileNotFoundError, match=r"there is no .*: play the robots \(python -m inbounds\.book\.motions"
    ):
        motions.read(folder)


@pytest.mark.parametrize(
    ("there", "said"), [(b"others", "is of other policies than"), (None, "is missing: restore it")]
)
def test_motions_of_other_policies_are_not_read(tmp_path: Path, there: bytes | None, said: str) -> None:
    folder = StudyFolder(tmp_path, tmp_path / "runs")
    for path in (SHIPPED.results / store.CHECKSUMS_FILE, motions.motions_file(SHIPPED)):
        shutil.copy(path, tmp_path)
    (tmp_path / "policies").mkdir()
    for name in motions.about(SHIPPED)["policies"]:
        path = SHIPPED.results / "policies" / f"{name}.safetensors"
        (tmp_path / "policies" / path.name).symlink_to(path)
    motions.read(folder)
    replaced = tmp_path / "policies" / "standard-swimmer-ppo-beta.safetensors"
    replaced.unlink()
    if there is not None:
        replaced.write_bytes(there)
    with pytest.raises(
        DamagedFileError, match=f"standard-swimmer-ppo-beta.*{said}|{said}.*-swimmer-ppo-beta"
    ):
        motions.read(folder)


@pytest.mark.slow
def test_swimmer_swims_as_it_did(kept: dict[str, np.ndarray]) -> None:
    """By the median nothing is drawn; what another processor rounds moves a stroke by little."""
    outcomes, name = Outcomes.read(SHIPPED), "standard-swimmer-ppo-beta"
    again = motions.stroke(*motions.swum(final_policies(outcomes, outcomes.finished[name])))
    for quantity, near in (("total", 5.0), ("fold", 5.0), ("discounted", 2.0)):
        away = np.abs(again[quantity] - kept[f"{name}/{quantity}"])
        assert np.median(away) < near, (quantity, away)
        assert np.sum(away < near) >= 8, (quantity, away)


@pytest.mark.slow
def test_robots_lie_where_they_lay(kept: dict[str, np.ndarray]) -> None:
    """Episodes with noise part between processors; over ten seeds the shares do not."""
    outcomes = Outcomes.read(SHIPPED)
    for name, policies in (
        ("untrained-logit-normal-default", motions.untrained_policies("logit-normal", None)),
        (
            "standard-halfcheetah-ppo-logit-normal",
            final_policies(outcomes, outcomes.finished["standard-halfcheetah-ppo-logit-normal"]),
        ),
    ):
        states, rewards = motions.episodes(policies)
        again = motions.posture(states, rewards)
        total = kept[f"{name}/down"] + kept[f"{name}/up"]
        assert (total == motions.EPISODES * motions.STEPS).all()
        assert abs(np.mean(again["down"] - kept[f"{name}/down"])) < 0.15 * total[0]
        pays = [(p[f"{at}down_pay"] + p[f"{at}up_pay"]).mean() for p, at in ((again, ""), (kept, f"{name}/"))]
        assert pays[0] == pytest.approx(pays[1], rel=0.2, abs=200)
        if f"{name}/asked" in kept:  # starts come from seeds, and are no matter of a processor
            np.testing.assert_allclose(kept[f"{name}/asked"][:, :, 0], states[:, :, 0], atol=1e-9)


def test_the_pages_play_nothing_whose_numbers_they_tell() -> None:
    """The instrument plays two policies, to be held against the package; the films and an exercise play for the eye."""
    code = [
        cell
        for page in (
            "inside_the_policies",
            "how_the_robots_move",
            "why_swimmer_folds",
            "how_far_an_update_goes",
        )
        for cell in cells_of(ROOT / "notebooks" / f"{page}.ipynb")
        if cell.cell_type == "code"
    ]
    playing = [
        cell for cell in code if ".step(" in cell.source and "solution" not in cell.metadata.get("tags", [])
    ]
    names = [cell.source.splitlines()[0] for cell in playing]
    assert names == [
        "def episodes(policies, number=3):",
        'env = gym.make("Swimmer-v5")',
        "def swim(outcome, seed):",
    ]
    calls = [
        line
        for cell in code
        for line in cell.source.splitlines()
        if "episodes(" in line and "def " not in line
    ]
    assert [line.strip() for line in calls] == [
        "(found[:, :, :20] for found in episodes(two)),",
        "motions.episodes(two, steps=20),",
    ]


def test_each_policy_upside_down_is_counted() -> None:
    states = np.zeros((2, 1, 4, 17))
    states[1, 0, 1:, 1] = np.pi
    found = motions.posture(states, np.arange(8.0).reshape(2, 1, 4))
    assert found["down"].tolist() == [0, 3]
    assert found["down_pay"].tolist() == [0, 5 + 6 + 7]
    assert found["up_pay"].tolist() == [6, 4]
