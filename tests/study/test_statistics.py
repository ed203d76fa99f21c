"""What seeds can say: intervals cover, tests keep their level, and no missing seed goes unnoticed."""

import itertools
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inbounds.study import statistics
from inbounds.study.statistics import MissingSeedError

NAN = float("nan")
numbers = st.floats(-1e3, 1e3).map(lambda x: round(x, 3))
samples = st.lists(numbers, min_size=2, max_size=13)
quick = settings(deadline=None, max_examples=40)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


# --- endpoints ---------------------------------------------------------------------------------------------------


def test_the_area_is_that_of_the_bars_over_their_length() -> None:
    curves = rng().normal(size=(2, 3, 50))
    bars = np.repeat(curves, 20, -1)  # each epoch as wide as the next
    assert np.allclose(statistics.area_under_curve(curves), bars.sum(-1) / bars.shape[-1])
    assert statistics.area_under_curve([[7.0]]).tolist() == [7.0]


@pytest.mark.parametrize(("epochs", "last"), [(500, 50), (30, 3), (5, 1), (11, 2), (1, 1)])
def test_the_final_score_is_the_mean_of_the_last_tenth_of_the_epochs(epochs: int, last: int) -> None:
    curves = rng().normal(size=(4, epochs))
    assert np.allclose(statistics.final_score(curves), curves[:, epochs - last :].mean(-1), rtol=1e-12)


def test_a_hole_in_a_curve_makes_its_endpoints_missing_and_no_others() -> None:
    curves = np.ones((3, 20))
    curves[1, 18] = NAN  # in the last tenth
    curves[2, 5] = NAN  # before it
    assert np.isnan(statistics.final_score(curves)).tolist() == [False, True, False]
    assert np.isnan(statistics.area_under_curve(curves)).tolist() == [False, True, True]


def test_gaps_take_the_last_known_return_and_the_first_where_there_is_none_before() -> None:
    curves = np.array([[NAN, 2.0, NAN, NAN, 5.0], [1.0, NAN, 3.0, NAN, NAN], [NAN] * 5])
    filled = statistics.carry_forward(curves)
    assert np.array_equal(filled, [[2, 2, 2, 2, 5], [1, 1, 3, 3, 3], [NAN] * 5], equal_nan=True)
    assert np.isnan(curves[0, 2]), "the caller's array was changed"
    with pytest.raises(MissingSeedError):
        statistics.bootstrap(statistics.final_score(filled, 0.4), rng())


@given(st.lists(st.one_of(st.just(NAN), numbers), min_size=1, max_size=8))
@quick
def test_filling_looks_back_and_then_ahead(curve: list[float]) -> None:
    for epoch, filled in enumerate(statistics.carry_forward([curve])[0]):
        nearest = [x for x in curve[epoch::-1] + curve[epoch:] if not np.isnan(x)]
        assert filled == nearest[0] if nearest else np.isnan(filled)


def test_normalised_scores_are_0_and_1_at_the_references() -> None:
    low, high = np.array([-3.0, 10.0]), np.array([5.0, 11.0])
    scores = statistics.normalize_scores(np.stack([low, high, 2 * high - low], -1), low, high)
    assert np.allclose(scores, [[0, 1, 2], [0, 1, 2]])
    with pytest.raises(ValueError, match="high above low"):
        statistics.normalize_scores([[1.0]], [2.0], [2.0])


def test_endpoints_refuse_what_is_no_curve() -> None:
    with pytest.raises(ValueError, match="at least one epoch"):
        statistics.final_score(np.ones((3, 0)))
    with pytest.raises(ValueError, match="fraction"):
        statistics.final_score(np.ones((3, 4)), fraction=0)


# --- missing seeds -----------------------------------------------------------------------------------------------

HOLE = [1.0, 2.0, NAN, 4.0, 3.0]
WHOLE = [1.5, 2.5, 0.5, 4.5, 3.0]
ON_SEEDS: list[Callable[..., object]] = [
    lambda x, **k: statistics.bootstrap(x, rng(), **k),
    lambda x, **k: statistics.learning_curve(np.array(x)[:, None] + np.arange(3), rng(), **k),
    lambda x, **k: statistics.difference(x, WHOLE, rng(), **k),
    lambda x, **k: statistics.difference(WHOLE, x, rng(), paired=True, **k),
    lambda x, **k: statistics.permutation_test(x, WHOLE, rng(), **k),
    lambda x, **k: statistics.permutation_test(WHOLE, x, rng(), paired=True, **k),
    lambda x, **k: statistics.equivalence(x, WHOLE, margin=1.0, **k),
    lambda x, **k: statistics.compare({"a": x}, {"a": WHOLE}, rng(), **k)["a"],
    lambda x, **k: statistics.aggregate({"a": WHOLE, "b": x}, rng(), **k),
    lambda x, **k: statistics.probability_of_improvement({"a": WHOLE}, {"a": x}, rng(), **k),
    lambda x, **k: statistics.performance_profile({"a": x}, [1.0, 2.0], rng(), **k).share,
]


@pytest.mark.parametrize("function", ON_SEEDS)
@pytest.mark.parametrize("hole", [NAN, np.inf, -np.inf])
def test_every_function_refuses_a_missing_seed_and_names_it(
    function: Callable[..., object], hole: float
) -> None:
    scores = [hole if np.isnan(x) else x for x in HOLE]
    with pytest.raises(MissingSeedError, match=r'position 2 of 5.*missing="exclude"'):
        function(scores)


@pytest.mark.parametrize("function", ON_SEEDS)
def test_a_seed_left_out_is_counted_and_changes_nothing_else(function: Callable[..., object]) -> None:
    result = function(HOLE, missing="exclude")
    estimate = getattr(result, "difference", result)
    if isinstance(estimate, statistics.Estimate):
        assert estimate.missing in (1, 2)  # of a pair, both
        assert estimate.n == 4
        assert np.isfinite([estimate.value, estimate.low, estimate.high]).all()
    else:  # a p-value, or a test of equivalence: that of the seeds that are there
        there, whole = [x for x in HOLE if not np.isnan(x)], WHOLE
        if function is ON_SEEDS[5]:  # in pairs
            whole = [y for x, y in zip(HOLE, WHOLE, strict=True) if not np.isnan(x)]
            expected: object = statistics.permutation_test(whole, there, rng(), paired=True)
        elif function is ON_SEEDS[4]:
            expected = statistics.permutation_test(there, whole, rng())
        else:
            expected = statistics.equivalence(there, whole, margin=1.0)
        assert result == expected
    if function is ON_SEEDS[0]:
        without = statistics.bootstrap([1.0, 2.0, 4.0, 3.0], rng())
        assert result == statistics.Estimate(
            without.value, without.low, without.high, 4, 1, 0.95, "IQM", ceiling=without.ceiling
        )


def test_robots_that_are_decided_each_its_own_way_leave_a_width() -> None:
    """Newcombe's limits of each robot, their distances added in quadrature: 1 and 0 of five seeds against five."""
    up, down = [4, 5, 6, 7, 8], [1, 2, 3, 0, -5]
    found = statistics.probability_of_improvement({"A": up, "B": down}, {"A": down, "B": up}, rng())
    one = statistics.probability_of_improvement({"A": up}, {"A": down}, rng())
    assert found.value == 0.5
    assert found.low == pytest.approx(0.5 - (1 - one.low) / 2)
    assert found.high == pytest.approx(0.5 + (1 - one.low) / 2)


def test_a_tie_of_means_has_one_interval() -> None:
    a, b = [1.0, 9.0, 0.0, 10.0, 5.0], [2.0, 8.0, 4.0, 6.0, 5.0]
    there, back = statistics.minus(a, b), statistics.minus(b, a)
    assert (there.low, there.high) == (-back.high, -back.low)


def test_a_tie_of_means_has_one_interval_with_a_seed_left_out() -> None:
    a, b = [NAN, 1.0, 9.0, 0.0, 10.0, 5.0], [2.0, 8.0, 4.0, 6.0, 5.0, NAN]
    there, back = statistics.minus(a, b), statistics.minus(b, a)
    assert (there.low, there.high) == (-back.high, -back.low)


def test_half_a_pair_is_no_pair() -> None:
    a, b = [1.0, NAN, 3.0, 4.0, 6.0], [0.0, 1.0, NAN, 1.0, 4.0]
    paired = statistics.difference(a, b, rng(), statistic="mean", paired=True, missing="exclude")
    assert paired.value == pytest.approx(2.0)
    assert (paired.n, paired.missing) == (3, 4)


def test_a_diverged_seed_leaves_the_whole_learning_curve() -> None:
    curves = np.tile(np.arange(6.0)[:, None], 4)
    curves[5, 2:] = NAN
    curve = statistics.learning_curve(curves, rng(), missing="exclude")
    assert np.allclose(curve.value, 2.0), "the diverged seed counts in the epochs before"
    assert (curve.n, curve.missing) == (5, 1)


def test_too_few_seeds_and_unknown_settings_are_refused() -> None:
    for bad, fix in [
        (lambda: statistics.bootstrap([1.0], rng()), "run more seeds"),
        (lambda: statistics.bootstrap([], rng()), "0 of 0 seeds have a finite score"),
        (lambda: statistics.bootstrap([NAN, NAN, 1.0], rng(), missing="exclude"), "run more seeds"),
        (lambda: statistics.bootstrap(WHOLE, rng(), missing="drop"), "raise, exclude"),
        (lambda: statistics.bootstrap(WHOLE, rng(), statistic="median"), "mean, iqm"),
        (lambda: statistics.bootstrap(WHOLE, rng(), level=95), "0.95"),
        (lambda: statistics.bootstrap(WHOLE, rng(), method="bca"), "expanded or percentile"),
        (lambda: statistics.bootstrap(WHOLE, rng(), resamples=10), "at least 100"),
        (lambda: statistics.difference(WHOLE, WHOLE[1:], rng(), paired=True), "paired=True"),
        (lambda: statistics.aggregate({}, rng()), "no environments"),
        (lambda: statistics.aggregate({"a": [[1.0]]}, rng()), "one score per seed"),
        (lambda: statistics.aggregate({"ant": [1.0, NAN]}, rng()), "ant: no finite score"),
        (
            lambda: statistics.probability_of_improvement({"a": WHOLE}, {"b": WHOLE}, rng()),
            "only one policy",
        ),
        (lambda: statistics.performance_profile({"a": WHOLE}, [[1.0]], rng()), "thresholds"),
        (lambda: statistics.equivalence(WHOLE, WHOLE, margin=0), "margin"),
        (lambda: statistics.holm([0.1, 1.2]), r"\[0, 1\]"),
        (lambda: statistics.power(-1, 10, rng()), "negative"),
        (lambda: statistics.smallest_detectable_effect(1, rng()), "n ≥ 2"),
        (lambda: statistics.learning_curve(WHOLE, rng()), "seeds, epochs"),
    ]:
        with pytest.raises(ValueError, match=fix):
            bad()


# --- one group ---------------------------------------------------------------------------------------------------


@given(samples)
@quick
def test_the_iqm_is_the_trimmed_mean_of_the_sample_repeated_four_times(values: list[float]) -> None:
    ours = statistics.interquartile_mean(values)
    assert ours == pytest.approx(stats.trim_mean(np.repeat(values, 4), 0.25), rel=1e-9, abs=1e-9)


def test_a_nan_among_the_values_is_not_trimmed_away() -> None:
    assert np.isnan(statistics.interquartile_mean([1.0, 2.0, NAN, 3.0, 4.0, 5.0]))


@given(st.lists(st.tuples(numbers, st.integers(0, 4)), min_size=1, max_size=10))
@quick
def test_weights_of_the_iqm_are_repetitions(pairs: list[tuple[float, int]]) -> None:
    values, counts = (np.array(x) for x in zip(*pairs, strict=True))
    if counts.sum():
        repeated = statistics.interquartile_mean(np.repeat(values, counts))
        assert statistics.interquartile_mean(values, counts) == pytest.approx(repeated, rel=1e-9, abs=1e-9)


def test_many_sets_of_weights_are_as_one_by_one() -> None:
    values, weights = rng().normal(size=12).round(), rng(1).multinomial(12, np.full(12, 1 / 12), size=7)
    one_by_one = [statistics.interquartile_mean(values, each).item() for each in weights]
    assert statistics.interquartile_mean(values, weights).tolist() == one_by_one
    spread_out = statistics.interquartile_mean(np.broadcast_to(values, weights.shape), weights)
    assert spread_out.tolist() == one_by_one
    assert statistics.interquartile_mean(values, 2.0) == statistics.interquartile_mean(values, np.ones(12))


def test_the_percentile_interval_is_that_of_scipy() -> None:
    scores = rng().gamma(2.0, size=10)
    ours = statistics.bootstrap(scores, rng(1), statistic="mean", method="percentile", resamples=40_000)
    peer = stats.bootstrap((scores,), np.mean, method="percentile", n_resamples=40_000, rng=rng(2))
    ends = peer.confidence_interval
    # Ends of two runs of 40 000 replicates: 0.02 is about four standard errors of their difference.
    assert (ours.low, ours.high) == pytest.approx((ends.low, ends.high), abs=0.02)


def test_the_expanded_interval_of_a_mean_is_close_to_students() -> None:
    scores = rng(3).normal(size=10)
    ours = statistics.bootstrap(scores, rng(1), statistic="mean", resamples=20_000)
    student = stats.ttest_1samp(scores, 0).confidence_interval(0.95)
    width = student.high - student.low
    assert ours.low == pytest.approx(student.low, abs=0.06 * width)
    assert ours.high == pytest.approx(student.high, abs=0.06 * width)


@given(samples, st.floats(0.5, 20), st.floats(-50, 50))
@quick
def test_intervals_move_with_the_unit_of_the_score(values: list[float], unit: float, zero: float) -> None:
    plain = statistics.bootstrap(values, rng(), resamples=200)
    moved = statistics.bootstrap(unit * np.array(values) + zero, rng(), resamples=200)
    for end in ("value", "low", "high"):
        assert getattr(moved, end) == pytest.approx(unit * getattr(plain, end) + zero, rel=1e-6, abs=1e-6)
    assert plain.low <= plain.high


def test_a_band_is_the_interval_of_every_epoch() -> None:
    curves = rng().normal(size=(10, 7)).cumsum(-1)
    band = statistics.learning_curve(curves, rng(5), resamples=500)
    one = statistics.bootstrap(curves[:, 3], rng(5), statistic="mean", resamples=500)
    assert (band.low[3], band.value[3], band.high[3]) == pytest.approx((one.low, one.value, one.high))


def test_one_generator_one_interval() -> None:
    scores = rng().normal(size=10)
    first, again, other = (statistics.bootstrap(scores, rng(seed)) for seed in (1, 1, 2))
    assert first == again
    assert first != other


# --- coverage: nominal 95 %, ten seeds; the standard error of a coverage is 0.6 points at 1200 experiments ----

LAWS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "normal": lambda g: g.normal(size=10),
    "skewed": lambda g: np.exp(0.5 * g.normal(size=10)),
    "two groups": lambda g: 0.3 * g.normal(size=10) + 2 * (g.random(10) < 0.3),
}
MEANS = {"normal": 0.0, "skewed": np.exp(0.125), "two groups": 0.6}


def ends(estimate: statistics.Estimate) -> tuple[float, float]:
    return float(estimate.low), float(estimate.high)


def covers(method: str, law: str, statistic: str, truth: float) -> float:
    draws, resamples = rng(11), rng(12)
    return statistics.coverage(
        lambda x: ends(statistics.bootstrap(x, resamples, statistic=statistic, method=method, resamples=600)),
        lambda _: LAWS[law](draws),
        truth,
        trials=600,
    )


@pytest.mark.parametrize("law", LAWS)
def test_means_of_ten_seeds_are_covered_and_the_plain_percentile_interval_falls_short(law: str) -> None:
    expanded, percentile = (covers(m, law, "mean", MEANS[law]) for m in ("expanded", "percentile"))
    # No interval that knows ten numbers alone sees the skewness: Student's t has 92.4 % there.
    assert (0.895 if law == "skewed" else 0.925) <= expanded <= 0.97
    assert percentile <= expanded - 0.02


@pytest.mark.parametrize(("n", "least"), [(3, 0.70), (4, 0.83), (5, 0.88)])
def test_few_seeds_cover_no_more_than_their_ceiling(n: int, least: float) -> None:
    draws, resamples = rng(13), rng(14)

    def interval(x: np.ndarray) -> tuple[float, float]:
        found = statistics.bootstrap(x, resamples, statistic="mean", resamples=1000)
        assert x.min() - 1e-12 <= found.low <= found.high <= x.max() + 1e-12
        assert found.ceiling == statistics.coverage_ceiling(n) < found.level
        return ends(found)

    share = statistics.coverage(interval, lambda _: draws.normal(size=n), 0.0, trials=1000)
    # The share of samples on both sides of their law's centre; its standard error is 1.4 points at most.
    assert least <= share <= statistics.coverage_ceiling(n) + 0.03


def test_the_ceiling_is_that_of_the_range() -> None:
    signs = np.array(
        list(itertools.product([-1, 1], repeat=6))
    )  # equally likely: on which side each seed lies
    assert np.mean(np.abs(signs.sum(1)) < 6) == statistics.coverage_ceiling(6)
    with pytest.raises(ValueError, match="at least one seed"):
        statistics.coverage_ceiling(0)


def test_who_has_a_ceiling() -> None:
    few, other = rng(1).normal(size=4), rng(2).normal(size=4)
    paired = statistics.difference(few, other, rng(), statistic="mean", paired=True)
    gap = few - other
    assert paired.ceiling == 0.875
    assert gap.min() - 1e-12 <= paired.low <= paired.high <= gap.max() + 1e-12
    apart = statistics.difference(few, other, rng(), statistic="mean")
    assert apart.ceiling == 1.0
    assert apart.low < gap.min()  # beyond what pairs could say


@pytest.mark.parametrize("law", LAWS)
def test_the_iqm_of_ten_seeds_is_covered_on_the_safe_side(law: str) -> None:
    many = np.stack([LAWS[law](g) for g in [rng(1)] for _ in range(40_000)])
    assert 0.94 <= covers("expanded", law, "iqm", float(statistics.interquartile_mean(many.ravel()))) <= 0.99


@pytest.mark.parametrize(("statistic", "upper"), [("mean", 0.98), ("iqm", 0.99)])
def test_differences_are_covered_under_unequal_spread(statistic: str, upper: float) -> None:
    g = rng(2)
    share = statistics.coverage(
        lambda x: ends(statistics.difference(x[0], x[1], g, statistic=statistic, resamples=600)),
        lambda _: np.stack([3 * g.normal(size=10), g.normal(size=10) + 1]),
        -1.0,
        trials=500,
    )
    assert 0.92 <= share <= upper


def test_paired_differences_are_covered_and_far_narrower_where_pairs_agree() -> None:
    g, widths = rng(3), {True: [], False: []}

    def interval(x: np.ndarray, paired: bool) -> tuple[float, float]:
        low, high = ends(statistics.difference(x[0], x[1], g, statistic="mean", paired=paired, resamples=400))
        widths[paired].append(high - low)
        return low, high

    def draw(_: int) -> np.ndarray:
        common = 5 * g.normal(size=10)
        return np.stack([common + g.normal(size=10) + 1, common + g.normal(size=10)])

    assert 0.91 <= statistics.coverage(lambda x: interval(x, True), draw, 1.0, trials=400) <= 0.98
    assert statistics.coverage(lambda x: interval(x, False), draw, 1.0, trials=100) == 1.0
    assert np.median(widths[True]) < 0.4 * np.median(widths[False])


def test_the_aggregate_iqm_is_covered_over_six_environments() -> None:
    g, centres = rng(4), np.array([0.0, 0.2, 0.5, 0.8, 1.0, 1.5])
    many = centres + 0.3 * g.normal(size=(200_000, 6))
    truth = float(statistics.interquartile_mean(many.ravel()))
    share = statistics.coverage(
        lambda x: ends(statistics.aggregate(dict(enumerate(x)), g, resamples=500)),
        lambda _: centres[:, None] + 0.3 * g.normal(size=(6, 10)),
        truth,
        trials=400,
    )
    assert 0.91 <= share <= 0.985


@pytest.mark.parametrize("shift", [0.0, 1.0, 3.0])
def test_the_probability_of_improvement_is_covered_near_the_edge_too(shift: float) -> None:
    g = rng(5)
    truth = float(stats.norm.cdf(shift / np.sqrt(2)))
    share = statistics.coverage(
        lambda x: ends(statistics.probability_of_improvement({"a": x[0]}, {"a": x[1]}, g, resamples=100)),
        lambda _: np.stack([g.normal(size=10) + shift, g.normal(size=10)]),
        truth,
        trials=500,
    )
    assert 0.92 <= share <= 1.0


# --- two groups --------------------------------------------------------------------------------------------------


def test_the_permutation_test_agrees_with_full_enumeration_of_welchs_t() -> None:
    a, b = rng(1).normal(2.5, 4.0, 4), rng(2).normal(0, 1, 8)
    pooled, everyone = np.concatenate([a, b]), range(12)
    splits = [
        [*left, *(i for i in everyone if i not in left)] for left in itertools.combinations(everyone, 4)
    ]
    shuffled = pooled[np.array(splits)]  # [495, 12]
    t = stats.ttest_ind(shuffled[:, :4], shuffled[:, 4:], axis=1, equal_var=False).statistic
    exact = np.mean(np.abs(t) >= np.abs(t[0]) - 1e-9)
    ours = statistics.permutation_test(a, b, rng(), permutations=20_000)
    assert ours == pytest.approx(exact, abs=4 * np.sqrt(exact / 20_000))


def test_the_paired_test_flips_every_sign() -> None:
    gaps = np.array([0.4, 1.1, -0.3, 0.8, 1.9, 0.2, 0.7])
    signs = np.array(list(itertools.product([-1, 1], repeat=7)))
    t = stats.ttest_1samp(signs * gaps, 0, axis=1).statistic
    exact = np.mean(np.abs(t) >= abs(stats.ttest_1samp(gaps, 0).statistic) - 1e-9)
    ours = statistics.permutation_test(gaps + 3, np.full(7, 3.0), rng(), paired=True, permutations=20_000)
    assert ours == pytest.approx(exact, abs=4 * np.sqrt(exact / 20_000))


@pytest.mark.parametrize("paired", [False, True])
def test_the_observed_order_counts_as_one_permutation(paired: bool) -> None:
    """Of groups far apart 2 in 2²⁰ orders at most are as extreme as the observed one: 99 draws have none."""
    a, b = rng(1).normal(1e3, 1, 20), rng(2).normal(0, 1, 20)
    assert statistics.permutation_test(a, b, rng(), paired=paired, permutations=99) == 1 / 100
    near = b[::-1] + 0.2  # about every second order is as extreme
    one = {statistics.permutation_test(near, b, rng(s), paired=paired, permutations=1) for s in range(40)}
    assert one == {1 / 2, 1.0}


def test_the_permutation_test_keeps_its_level_under_unequal_spread() -> None:
    g = rng(6)
    rejected = [
        statistics.permutation_test(3 * g.normal(size=6), g.normal(size=14), g, permutations=199) <= 0.05
        for _ in range(500)
    ]
    assert 0.02 <= np.mean(rejected) <= 0.1  # without the studentisation about 0.2


def test_seeds_without_scatter_are_no_division_by_zero() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert statistics.permutation_test([1.0] * 4, [1.0] * 4, rng()) == 1.0
        assert statistics.permutation_test([1.0] * 6, [2.0] * 6, rng()) < 0.01
        same = statistics.difference([1.0] * 4, [3.0] * 4, rng())
        assert (same.low, same.value, same.high) == (-2.0, -2.0, -2.0)
        assert statistics.equivalence([1.0] * 4, [1.0] * 4, margin=0.1).equivalent


@given(st.lists(st.floats(0, 1), min_size=1, max_size=7))
@quick
def test_holm_is_the_closed_test_of_bonferroni(p_values: list[float]) -> None:
    """The closure: an adjusted p-value is the largest Bonferroni p over all subfamilies with that test."""
    m = len(p_values)
    expected = [
        max(
            min(1.0, len(family) * min(p_values[j] for j in family))
            for size in range(1, m + 1)
            for family in itertools.combinations(range(m), size)
            if i in family
        )
        for i in range(m)
    ]
    assert statistics.holm(p_values) == pytest.approx(expected)


def test_holm_counts_the_test_that_could_not_be_made() -> None:
    adjusted = statistics.holm([0.01, NAN, 0.02])
    assert np.array_equal(adjusted.round(9), [0.03, NAN, 0.04], equal_nan=True)


def test_a_comparison_marks_the_missing_cell_and_keeps_it_in_the_family() -> None:
    g = rng(7)
    a = {"x": g.normal(3, 1, 10), "y": g.normal(0, 1, 10)}
    b = {"x": g.normal(0, 1, 10), "z": g.normal(0, 1, 10)}
    rows = statistics.compare(a, b, g, environments=["x", "y", "z", "w"])
    assert list(rows) == ["x", "y", "z", "w"]
    assert [rows[e].difference is None for e in rows] == [False, True, True, True]
    assert rows["x"].p_adjusted == pytest.approx(4 * rows["x"].p_value)
    assert np.isnan([rows[e].p_adjusted for e in "yzw"]).all()


@pytest.mark.parametrize("paired", [False, True])
@pytest.mark.parametrize("shift", [0.0, 0.8, -1.4])
def test_equivalence_is_two_tests_of_scipy(paired: bool, shift: float) -> None:
    a, b, margin = rng(1).normal(shift, 2, 10), rng(2).normal(0, 1, 10), 1.5

    def one_sided(offset: float, alternative: str) -> float:
        if paired:
            return stats.ttest_rel(a + offset, b, alternative=alternative).pvalue
        return stats.ttest_ind(a + offset, b, equal_var=False, alternative=alternative).pvalue

    outcome = statistics.equivalence(a, b, margin, paired=paired)
    expected = max(one_sided(margin, "greater"), one_sided(-margin, "less"))
    assert outcome.p_value == pytest.approx(expected)
    inside = -margin < outcome.low and outcome.high < margin
    assert outcome.equivalent == inside == (expected < 0.05)


def test_equivalence_is_rarely_claimed_at_the_margin() -> None:
    g = rng(8)
    claims = [
        statistics.equivalence(g.normal(1, 0.5, 10), g.normal(0, 0.5, 10), 1.0).equivalent for _ in range(600)
    ]
    assert 0.02 <= np.mean(claims) <= 0.08


# --- aggregates --------------------------------------------------------------------------------------------------


# The numbers of rliable 1.2 (with arch 7.2, pandas 2.3) on twelve runs of three tasks, computed once: its dependencies
# do not fit the pinned ones. Twelve, because there its trimmed mean and the interquartile mean are one thing.
RUNS, TASKS = np.arange(12)[:, None], np.arange(3)[None]
X = np.round(np.sin(1.7 * RUNS + 2.3 * TASKS) + 0.3 * TASKS + 1, 3)
Y = np.round(np.cos(1.1 * RUNS + 0.9 * TASKS) + 0.1 * TASKS + 0.9, 3)


def by_task(scores: np.ndarray) -> dict[str, np.ndarray]:
    return {f"task {i}": scores[:, i] for i in range(3)}


def test_aggregates_are_those_of_rliable() -> None:
    iqm, mean = (statistics.aggregate(by_task(X), rng(), statistic=s) for s in ("iqm", "mean"))
    # Ends of intervals: rliable's from 50 000 resamples, ours from 5000; 0.02 is three standard errors of ours.
    assert iqm.value == pytest.approx(1.28216667, abs=1e-8)
    assert ends(iqm) == pytest.approx((0.9457, 1.6251), abs=0.02)
    assert mean.value == pytest.approx(1.29313889, abs=1e-8)
    assert ends(mean) == pytest.approx((1.0613, 1.5233), abs=0.02)


def test_the_probability_of_improvement_is_rliables() -> None:
    ours = statistics.probability_of_improvement(by_task(X), by_task(Y), rng())
    assert ours.value == pytest.approx(0.6087962962962963)
    assert ends(ours) == pytest.approx((0.4745, 0.7362), abs=0.01)


def test_profiles_are_those_of_rliable() -> None:
    share = statistics.performance_profile(by_task(X), [0.0, 0.5, 1.0, 1.5, 2.0], rng()).share
    # In steps of 1/36, one run; an end may fall on the next step.
    assert share.value == pytest.approx([1, 0.83333333, 0.55555556, 0.41666667, 0.22222222])
    assert share.low == pytest.approx([1, 0.72222222, 0.38888889, 0.25, 0.11111111], abs=0.029)
    assert share.high == pytest.approx([1, 0.94444444, 0.72222222, 0.58333333, 0.36111111], abs=0.029)


def test_every_environment_weighs_the_same_however_many_seeds_count() -> None:
    full = {"a": [0.0, 1.0, 2.0, 3.0], "b": [10.0, 11.0, 12.0, 13.0]}
    doubled = {"a": [0.0, 1.0, 2.0, 3.0] * 2, "b": full["b"]}
    for statistic in ("mean", "iqm"):
        values = [
            statistics.aggregate(x, rng(), statistic=statistic, resamples=100).value for x in (full, doubled)
        ]
        assert values[0] == pytest.approx(values[1])


def test_the_bootstrap_is_stratified() -> None:
    """Environments far apart and without scatter: drawn within each, the mean cannot move."""
    far = {"a": [0.0] * 5, "b": [1000.0] * 5}
    estimate = statistics.aggregate(far, rng(), statistic="mean")
    assert (estimate.low, estimate.high) == pytest.approx((500.0, 500.0))


@given(samples, samples)
@quick
def test_the_probability_of_improvement_is_mann_whitneys(a: list[float], b: list[float]) -> None:
    ours = statistics.probability_of_improvement({"e": a}, {"e": b}, rng(), resamples=100)
    u = stats.mannwhitneyu(a, b).statistic
    assert ours.value == pytest.approx(u / (len(a) * len(b)))
    back = statistics.probability_of_improvement({"e": b}, {"e": a}, rng(), resamples=100)
    assert ends(back) == pytest.approx((1 - ours.high, 1 - ours.low), abs=1e-9)
    assert 0 <= ours.low <= ours.value <= ours.high <= 1


def test_winning_every_comparison_is_no_certainty() -> None:
    a, b = (
        {"x": np.arange(10.0) + 100, "y": np.arange(10.0) + 100},
        {"x": np.arange(10.0), "y": np.arange(10.0)},
    )
    always = statistics.probability_of_improvement(a, b, rng())
    never = statistics.probability_of_improvement(b, a, rng())
    assert (always.value, always.high) == (1.0, 1.0)
    assert 0.6 < always.low < 0.95
    assert never.high == pytest.approx(1 - always.low)


def test_a_profile_falls_from_one_to_zero_and_its_area_is_the_mean() -> None:
    scores = {"a": rng(1).random(10), "b": rng(2).random(10)}
    taus = np.linspace(0, 1, 4001)
    profile = statistics.performance_profile(scores, taus, rng(), resamples=200)
    assert (np.diff(profile.share.value) <= 0).all()
    assert np.trapezoid(profile.share.value, taus) == pytest.approx(
        np.mean(list(scores.values())), abs=2.5e-4
    )
    assert (profile.share.low <= profile.share.high).all()


# --- power -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "n"), [(0.0, 10), (0.5, 10), (1.3, 10), (1.0, 20), (2.0, 5)])
def test_power_is_that_of_the_noncentral_t(effect: float, n: int) -> None:
    freedom = 2 * n - 2
    exact = stats.nct.sf(stats.t.isf(0.025, freedom), freedom, effect * np.sqrt(n / 2))
    # Welch's test is a little more careful than the pooled one, by two points at n = 5 and next to nothing at 10.
    assert exact - (0.03 if n < 10 else 0.015) <= statistics.power(effect, n, rng()) <= exact + 0.01


def test_ten_seeds_resolve_about_one_and_a_third_standard_deviations() -> None:
    effect = statistics.smallest_detectable_effect(10, rng(), trials=50_000)
    assert effect == pytest.approx(1.33, abs=0.03)
    assert statistics.power(effect, 10, rng(1)) == pytest.approx(0.8, abs=0.015)
    assert statistics.smallest_detectable_effect(10, rng(), chance=0.01) == 0.0  # found as often without one
    of_six = statistics.smallest_detectable_effect(10, rng(), tests=6)
    assert of_six > 1.25 * effect


def test_arrays_are_no_scores_by_environment() -> None:
    scores = np.arange(20.0).reshape(2, 10)
    for first, second in (
        (scores, scores),
        ({"Hopper-v5": scores[0]}, scores[1]),
        (scores[0], {"Hopper-v5": scores[1]}),
    ):
        with pytest.raises(TypeError, match=r"scores by environment.*ndarray.*`difference`"):
            statistics.compare(first, second, np.random.default_rng(0))
