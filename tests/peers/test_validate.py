"""The test of equivalence is a test, and the validation resumes."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from benchmarks import validate
from benchmarks.equivalence import area, equivalence, seeds_needed
from benchmarks.published import RESULTS


def test_against_a_peer_without_noise_it_is_two_one_sample_tests() -> None:
    rng = np.random.default_rng(0)
    ours, theirs = rng.normal(100, 10, 12), 100 + 1e-9 * rng.normal(size=12)
    outcome = equivalence(ours, theirs, margin=0.1)
    low = stats.ttest_1samp(ours, 90, alternative="greater").pvalue
    high = stats.ttest_1samp(ours, 110, alternative="less").pvalue
    assert outcome.p_value == pytest.approx(max(low, high), rel=1e-6)
    interval = stats.t.interval(0.9, 11, ours.mean(), stats.sem(ours))
    assert (100 * outcome.low, 100 * outcome.high) == pytest.approx(interval, rel=1e-6)


@pytest.mark.parametrize("true_ratio", [0.85, 1.15])
def test_at_the_edge_of_the_margin_it_errs_no_more_often_than_it_says(true_ratio: float) -> None:
    rng = np.random.default_rng(1)
    verdicts = [
        equivalence(rng.normal(true_ratio * 100, 8, 10), rng.normal(100, 8, 10)).equivalent
        for _ in range(600)
    ]
    assert 0.02 < np.mean(verdicts) < 0.08


def test_the_verdict_is_the_interval_within_the_margin() -> None:
    rng = np.random.default_rng(2)
    for ratio in (0.8, 0.9, 1.0, 1.1, 1.2):
        outcome = equivalence(rng.normal(ratio * 50, 4, 10), rng.normal(50, 4, 10))
        assert outcome.equivalent == (outcome.low > 0.85 and outcome.high < 1.15)
        assert outcome.low < outcome.ratio < outcome.high


def test_with_the_seeds_needed_it_succeeds_in_eight_of_ten_cases() -> None:
    rng = np.random.default_rng(3)
    n = seeds_needed(*100 + 20 * rng.normal(size=(2, 10_000)))
    assert 28 <= n <= 33
    verdicts = [equivalence(*100 + 20 * rng.normal(size=(2, n))).equivalent for _ in range(300)]
    assert 0.7 < np.mean(verdicts) < 0.9


def test_it_says_when_there_is_nothing_to_compare_with() -> None:
    with pytest.raises(ValueError, match="train longer"):
        equivalence([1.0, 2.0], [-3.0, -2.0])
    with pytest.raises(ValueError, match="at least two seeds"):
        equivalence([1.0], [1.0, 2.0])


def test_epochs_without_an_episode_do_not_count_as_bad_ones() -> None:
    nan = np.nan
    assert area([[nan, 2.0, nan, nan, 6.0], [1.0, 1.0, 1.0, 1.0, 1.0]]).tolist() == [14 / 5, 1.0]


def test_points_of_a_curve_are_means_of_ten_epochs() -> None:
    values = np.arange(50.0).reshape(2, 25)
    values[0, 3] = np.nan  # an epoch in which no episode ended
    np.testing.assert_allclose(validate.in_groups(values, 10), [[42 / 9, 14.5], [29.5, 39.5]])


def test_the_stored_areas_come_out_of_the_stored_curves() -> None:
    folder = RESULTS / "validation"
    stored = json.loads((folder / "validation.json").read_text(encoding="utf8"))
    table = pq.read_table(folder / "curves.parquet")
    for env, verdict in stored["verdicts"].items():
        for who in (validate.OURS, validate.PEER):
            assert area(validate.curves(table, env, who)).tolist() == verdict[who]["areas"]


def test_fewer_seeds_or_other_settings_do_not_replace_what_is_stored() -> None:
    folder = RESULTS / "validation"
    file = folder / "validation.json"
    stored = json.loads(file.read_text(encoding="utf8"))
    same = {name: stored[name] for name in ("seeds", "env_steps", "normalize_obs", "margin")}
    more = {env: 2 * seeds for env, seeds in stored["seeds"].items()}
    for asked in (same, same | {"seeds": more | {"Ant-v5": 2}}):
        assert validate.place_beside(file, asked) == (folder, "")
    one = dict(list(stored["seeds"].items())[:1])
    for change, why in (
        ({"seeds": one}, "HalfCheetah-v5: 0 instead of"),
        ({"env_steps": 61440}, "env_steps: 61440 instead of"),
        ({"normalize_obs": True}, "normalize_obs: True instead of False"),
        ({"margin": 0.1}, "margin: 0.1 instead of 0.15"),
    ):
        target, said = validate.place_beside(file, same | change)
        assert target == RESULTS / "some" / "validation"
        assert why in said


def test_a_curve_that_ends_without_a_return_has_no_area() -> None:
    nan = np.nan
    areas = area([[1.0, 2.0, nan], [nan, nan, nan], [2.0, nan, 4.0]])
    assert np.array_equal(areas, [nan, nan, 8 / 3], equal_nan=True)
    assert np.isnan(area([[[1.0, nan]]])).shape == (1, 1)
    with pytest.raises(ValueError, match="diverged or was cut short"):
        equivalence(areas, [2.0, 2.1, 2.2])
    with pytest.raises(ValueError, match="diverged or was cut short"):
        equivalence([2.0, 2.1, 2.2], areas)


@pytest.mark.slow
def test_a_quick_validation_judges_and_is_not_run_twice(tmp_path, capsys, monkeypatch) -> None:
    validate.main(["--quick", "--output", str(tmp_path), "--workers", "1"])
    folder = tmp_path / "quick"
    results = json.loads((folder / "validation.json").read_text())
    verdict = results["verdicts"]["Hopper-v5"]
    assert {len(verdict[who]["areas"]) for who in (validate.OURS, validate.PEER)} == {2}
    assert (
        min(verdict[validate.OURS]["areas"] + verdict[validate.PEER]["areas"]) > 1
    )  # the Hopper stays up a little
    assert (folder / "curves.parquet").exists()
    assert (folder / "validation.svg").stat().st_size > 1000

    monkeypatch.setattr(validate, "run_jobs", lambda *_: pytest.fail("everything is there"))
    validate.main(["--quick", "--output", str(tmp_path)])
    assert "Hopper-v5" in capsys.readouterr().out
    (missing,) = folder.glob(f"runs/Hopper-v5-{validate.PEER}-*-1.parquet")
    missing.unlink()
    sides = [
        validate.Job("Hopper-v5", who, (0, 1), 2, 256, False, folder)
        for who in (validate.OURS, validate.PEER)
    ]
    (job,) = validate.jobs(sides)
    assert (job.who, job.seeds) == (validate.PEER, (1,))
