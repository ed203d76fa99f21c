"""What is written for the page: small enough, complete, and the numbers of the study."""

import base64
import gzip
import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.drawing.videos import VideoRow
from inbounds.book.live import export, site
from inbounds.book.live.element import POLICIES, live_robot, style_sheet
from inbounds.book.live.packages import without_custom_sections
from inbounds.learning import Trainer
from inbounds.study.grid import ROBOTS, select
from inbounds.study.store import StudyFolder


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("live")
    assert export.write(folder) <= site.LARGEST
    return folder


def read(path: Path) -> object:
    """The JSON of a script."""
    return json.loads(path.read_text(encoding="utf8").partition(" = ")[2].rstrip().rstrip(";"))


def test_every_choice_of_the_page_has_its_file(written: Path) -> None:
    known = read(written / "catalogue.js")
    assert tuple(known["policies"]) == POLICIES
    for robot in known["robots"]:
        assert (written / "robots" / f"{robot}.js").is_file()
        for seed in known["seeds"]:
            assert (written / "starts" / f"{robot.lower()}-{seed}.js").is_file()
            for policy in known["policies"]:
                assert (written / "policies" / f"{robot.lower()}-{policy}-{seed}.js").is_file()
    assert tuple(known["robots"]) == ROBOTS


def test_a_policy_s_numbers_are_the_study_s(written: Path) -> None:
    (cell,) = select(["standard-ant-trpo-logit-normal"])
    stored = read(written / "policies" / "ant-trpo-logit-normal-4.js")
    policy = StudyFolder.shipped().load_policies(cell)[4]
    data = gzip.decompress(base64.b64decode(stored["numbers"]))
    count = sum(out * (into + 1) for into, out in itertools.pairwise(stored["sizes"]))
    np.testing.assert_array_equal(
        np.frombuffer(data[: 4 * count], np.float32), policy._network.theta[0].numpy()
    )
    np.testing.assert_array_equal(
        np.frombuffer(data[4 * count :])[: stored["sizes"][0]], policy._normalizer.mean[0]
    )
    assert len(data) == 4 * count + 2 * 8 * stored["sizes"][0]
    assert stored["family"] == "logit-normal"


@pytest.mark.parametrize("column", ["ppo-beta", "trpo-gaussian"])
def test_a_start_is_what_training_began_with(written: Path, column: str) -> None:
    """Of every algorithm and family: the networks that a fresh run has."""
    (cell,) = select([f"standard-hopper-{column}"])
    theta = Trainer(cell.config).networks.actor.theta
    for seed in (0, 9):
        data = gzip.decompress(base64.b64decode(read(written / "starts" / f"hopper-{seed}.js")))
        np.testing.assert_array_equal(np.frombuffer(data, np.float32), theta[seed].numpy())


def test_a_robot_is_the_package_s(written: Path) -> None:
    stored = read(written / "robots" / "Humanoid.js")
    assert stored["name"] == "Humanoid-v5"
    assert len(stored["motors"]) == 17
    assert stored["task"]["frame_skip"] == 5
    assert stored["task"]["contact_limit"] == 10.0
    assert "velocity_limit" not in stored["task"]
    assert stored["xml"].startswith("<mujoco")


def test_a_module_keeps_what_runs() -> None:
    long = b"\0\x80\x02" + bytes(256)  # a custom section whose size takes two bytes
    module = b"\0asm\1\0\0\0" + long + b"\1\2ab" + b"\0\1x" + b"\x0a\1c"
    assert without_custom_sections(module) == b"\0asm\1\0\0\0" + b"\1\2ab" + b"\x0a\1c"
    with pytest.raises(ValueError, match="not a WebAssembly module"):
        without_custom_sections(b"MZ")


def test_an_element_is_fixed_and_asks_no_other_host() -> None:
    element = live_robot(VideoRow([]), "Ant", "trpo-gaussian", "")
    html = element._repr_html_()
    assert html == live_robot(VideoRow([]), "Ant", "trpo-gaussian", "")._repr_html_()
    assert 'class="inbounds-live-robot"' in html  # by which the build finds the pages that need the scripts
    assert "<script" not in html
    assert "http" not in html
    assert 'data-right=""' in html
    assert repr(element) == "Live robot: Ant, trpo-gaussian"
    assert "--inbounds-live-logit-normal: #0E2F66" in style_sheet()


@pytest.mark.parametrize(
    ("robot", "left"), [("Cartpole", "ppo-beta"), ("Hopper", "trpo-beta"), ("Hopper", "")]
)
def test_what_was_not_trained_is_refused(robot: str, left: str) -> None:
    with pytest.raises(ValueError, match=r"there (is no robot|are ppo-gaussian)"):
        live_robot(VideoRow([]), robot, left)


@pytest.mark.parametrize("seed", [-1, 10, 42])
def test_a_seed_that_was_not_trained_is_refused(seed: int) -> None:
    assert live_robot(VideoRow([]), seed=9).seed == 9
    with pytest.raises(ValueError, match=f"with seed {seed}: choose one of 0 to 9"):
        live_robot(VideoRow([]), seed=seed)


def test_a_way_to_act_must_be_the_family_s() -> None:
    element = live_robot(VideoRow([]), "Ant", "ppo-beta", "ppo-beta", ways=("median", "mode"))
    assert 'data-ways="median mode"' in element._repr_html_()
    with pytest.raises(ValueError, match=r"gaussian acts by median, sample, .* not by 'mode'"):
        live_robot(VideoRow([]), "Ant", "ppo-gaussian", "ppo-beta", ways=("mode", "mode"))


def test_without_npm_there_is_a_line_that_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable() -> Path:
        raise site.NpmError("npm could not bring the packages: no network")

    monkeypatch.setattr(site, "bundle", unreachable)
    assert "no network" in site.write(tmp_path / "live")
    assert sorted(path.name for path in (tmp_path / "live").iterdir()) == ["boot.js", "status.js"]
    assert "npm could not be reached" in (tmp_path / "live" / "status.js").read_text(encoding="utf8")


def test_scripts_can_be_read_in_one_sitting() -> None:
    for path in [*site.JS.glob("*.js"), *site.scripts()]:
        assert len(path.read_text(encoding="utf8").splitlines()) <= 350
