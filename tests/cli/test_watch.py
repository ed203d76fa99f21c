import errno
import os
import re
from pathlib import Path

import gymnasium
import imageio_ffmpeg
import numpy as np
import pytest

from inbounds import robots
from inbounds.learning.storage.run_store import load_policy
from tests.cli.small import run, small, succeeds


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    succeeds(small(folder / "hopper", 2))
    succeeds(small(folder / "beta", 1, "Swimmer-v5", "--policy", "beta"))
    return folder


@pytest.mark.parametrize("greedy", ["median", "mode", "sample"])
def test_the_film_shows_the_rollout_that_gymnasium_gives(greedy: str, runs: Path, tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    words = ["watch", runs / "hopper", "--greedy", greedy, "--seed-index", "1", "--seconds", "0.2"]
    out = succeeds([*words, "--env-seed", "5", "--width", "64", "--height", "48", "--out", film])

    env = gymnasium.make("Hopper-v5")
    policy, rng = load_policy(runs / "hopper", seed_index=1), np.random.default_rng(5)
    obs, _ = env.reset(seed=5)
    _, seconds = imageio_ffmpeg.count_frames_and_secs(film)
    total = 0.0
    for _ in range(round(seconds / env.unwrapped.dt)):
        obs, reward, terminated, truncated, _ = env.step(policy.act(obs, greedy, rng))
        total += reward
        if terminated or truncated:
            obs, _ = env.reset()
    assert f"return {total:.1f} in 0.2 s" in out
    assert f"seed 1, acting by {greedy}" in out
    assert abs(seconds - 0.2) < 0.05


def test_by_default_the_median_of_the_first_seed_in_the_run_directory(runs: Path) -> None:
    out = succeeds(["watch", runs / "hopper", "--seconds", "3", "--width", "64", "--height", "48"])
    assert "seed 0, acting by median" in out
    total, told = re.search(r"return (\S+) in .* episodes: (.*)\)", out).groups()  # an untrained hopper falls
    whole = sum(map(float, told.removesuffix(", and one under way").split(", ")))
    assert (abs(float(total) - whole) > 0.05 * (told.count(",") + 1)) == told.endswith(", and one under way")
    assert (runs / "hopper" / "median-seed0.mp4").stat().st_size > 1000
    out = succeeds(
        [
            "watch",
            runs / "beta" / "policies.safetensors",
            "--seconds",
            "0.2",
            "--width",
            "64",
            "--height",
            "48",
        ]
    )
    assert "Swimmer-v5, beta, seed 0, acting by" in out


def test_what_has_no_simulation_is_trained_and_not_filmed(tmp_path: Path) -> None:
    out = succeeds(small(tmp_path / "car", 1, "MountainCarContinuous-v0"))
    assert "film it" not in out
    code, _, err = run("watch", tmp_path / "car", "--seconds", "0.1")
    assert code == 1
    assert (
        "Continuous_MountainCarEnv gives no access to a MuJoCo simulation: only MuJoCo's robots can be drawn"
        in err
    )


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("nowhere", 1, "choose one of {runs}/beta, {runs}/hopper"),
        ("hopper --seed-index 2", 2, "the run has 2 seeds, 0 to 1"),
        ("hopper --seconds 0", 2, "must be positive"),
        ("hopper --seconds inf", 2, "must be positive numbers"),
        ("hopper --env-seed -1", 2, "--env-seed must be 0 or more"),
        (f"hopper --out {300 * 'a'}/film.mp4", 2, "too long for the disk"),
        ("hopper --seconds 0.1 --width 100000", 1, "choose a smaller width and height"),
        ("hopper --width 100000 --height 100000", 1, "choose a smaller width and height"),
        ("hopper --seconds 1e9", 1, "choose fewer --seconds, or a smaller --width and --height"),
        ("hopper --seconds 1e300", 1, "choose fewer --seconds, or a smaller --width and --height"),
        ("hopper --width 63 --seconds 0.1", 2, "must be even"),
        ("hopper --out no/such/folder/film.mp4", 1, "mkdir -p no/such/folder"),
        ("hopper --out .", 2, ". is a folder: name the film (--out film.mp4)"),
        ("hopper --out film.gif", 2, "a film is an MP4: --out film.mp4"),
    ],
)
def test_what_cannot_be_watched(words: str, code: int, message: str, runs: Path) -> None:
    name, *more = words.split()
    got, _, err = run("watch", runs / name, *more)
    assert got == code
    assert message.format(runs=runs) in err
    assert err.count("\n") == 1
    assert "libegl1" not in err


def test_a_full_disk_leaves_no_film(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    out = tmp_path / "film.mp4"
    code, _, err = run(
        "watch", runs / "hopper", "--seconds", "0.1", "--width", "64", "--height", "48", "--out", out
    )
    assert code == 1
    assert "Free some space on the disk" in err
    assert not list(tmp_path.iterdir())


def test_without_an_encoder_no_film_is_begun(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing() -> None:
        raise RuntimeError

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", nothing)
    monkeypatch.setattr(robots, "record", lambda *args, **kwargs: pytest.fail("a film was made"))
    code, _, err = run("watch", runs / "hopper", "--seconds", "0.1")
    assert code == 1
    assert "pip install --force-reinstall imageio-ffmpeg" in err


def test_paths_with_spaces_are_quoted_in_advice(tmp_path: Path) -> None:
    out = succeeds(small(tmp_path / "my run", 1))
    assert f"film it: inbounds watch '{tmp_path / 'my run'}'" in out
    _, _, err = run("watch", tmp_path / "nowhere")
    assert f"choose one of '{tmp_path / 'my run'}'" in err
    _, _, err = run("watch", tmp_path / "my run", "--out", tmp_path / "no folder" / "film.mp4")
    assert f"mkdir -p '{tmp_path / 'no folder'}'" in err
