"""The dial's task against its own definition: optimum and idle return by search, moments by quadrature, no coupling."""

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from inbounds.learning.rollout import check_environments
from inbounds.study.dial.laws import concentrations, expected_return, information, moments, start
from inbounds.study.dial.task import DialEnv, DialTask

TASKS = [
    DialTask(f, c, charged=charged)
    for f in (0.25, 0.9, 1.5, 3.0)
    for c, charged in ((0.0, "executed"), (1.0, "raw"), (1.0, "executed"))
]
OUTPUTS = [np.array(pair) for pair in ([0.0, -1.0], [0.8, 0.3], [2.5, -0.5], [-1.2, 0.9])]


@pytest.mark.parametrize("task", TASKS, ids=str)
def test_optimum_and_idle_return_are_those_of_the_reward(task: DialTask) -> None:
    found = optimize.minimize_scalar(
        lambda a: -task.reward(np.array([a]), np.array([1.0])), bounds=(-1, 1), method="bounded"
    )
    assert -found.fun == pytest.approx(task.best_return, abs=1e-4)
    assert found.x == pytest.approx(task.best, abs=1e-4)
    assert task.reward(np.zeros(1), np.ones(1)) == pytest.approx(task.idle_return)
    beyond = task.reward(np.linspace(1, 5, 50)[:, None], np.ones(1))
    assert (beyond <= task.best_return + 1e-12).all()
    assert task.score(task.best_return) == pytest.approx(1)


@pytest.mark.parametrize("fraction", [0.25, 0.9, 1.0])
def test_a_cost_on_the_executed_action_only_stretches_the_reward(fraction: float) -> None:
    action, sign = np.linspace(-2, 2, 41)[:, None], np.ones(1)
    free, priced = DialTask(fraction), DialTask(fraction, 1.0)
    np.testing.assert_allclose(
        free.score(free.reward(action, sign)), priced.score(priced.reward(action, sign))
    )


def integral(family: str, outputs: np.ndarray, function) -> float:
    """E function(a) of the raw action, by adaptive quadrature from SciPy's laws."""
    if family == "beta":
        law, map_ = stats.beta(*concentrations(outputs)), lambda x: 2 * x - 1
        edges = [0, 0.5, 1]
    else:
        law = stats.norm(outputs[0], math.exp(outputs[1]))
        map_ = (lambda z: z) if family == "gaussian" else (lambda z: math.tanh(z / 2))
        edges = sorted({law.mean() - 12 * law.std(), -1.0, 1.0, law.mean(), law.mean() + 12 * law.std()})
    return sum(
        integrate.quad(lambda x: law.pdf(x) * function(map_(x)), a, b, epsabs=1e-11)[0]
        for a, b in itertools.pairwise(edges)
    )


@pytest.mark.parametrize("family", ["gaussian", "beta", "logit-normal"])
@pytest.mark.parametrize("outputs", OUTPUTS, ids=str)
def test_moments_are_integrals(family: str, outputs: np.ndarray) -> None:
    expected = [
        integral(family, outputs, lambda a: min(max(a, -1), 1)),
        integral(family, outputs, lambda a: min(max(a, -1), 1) ** 2),
        integral(family, outputs, lambda a: a**2),
    ]
    np.testing.assert_allclose(moments(family, outputs), expected, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("task", TASKS, ids=str)
@pytest.mark.parametrize("family", ["gaussian", "beta", "logit-normal"])
def test_the_expected_return_is_the_integral_of_the_reward(task: DialTask, family: str) -> None:
    one = np.ones(1)
    for outputs in OUTPUTS:
        expected = integral(family, outputs, lambda a: float(task.reward(np.array([a]), one)))
        assert expected_return(task, family, outputs) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("family", ["gaussian", "beta", "logit-normal"])
def test_all_start_with_the_same_executed_noise(family: str) -> None:
    mean, square, _ = moments(family, start(family, 0.4))
    assert mean == pytest.approx(0, abs=1e-9)
    assert math.sqrt(square) == pytest.approx(0.4, abs=1e-4)


def test_information_of_a_beta_is_the_curvature_of_its_divergence() -> None:
    outputs, h = np.array([1.0, -0.3]), 1e-3
    full = information("beta", outputs)
    a, b = concentrations(outputs)
    law = stats.beta(a, b)
    for k in (0, 1):
        moved = stats.beta(*concentrations(outputs + h * np.eye(2)[k]))
        divergence = integrate.quad(lambda x, m=moved: law.pdf(x) * (law.logpdf(x) - m.logpdf(x)), 0, 1)[0]
        assert 2 * divergence / h**2 == pytest.approx(full[k, k], rel=2e-3)


def test_seeds_are_gymnasiums() -> None:
    task = DialTask(0.5, dims=3)
    each, counted = DialEnv(task, 3), DialEnv(task, 3)
    first, _ = counted.reset(seed=4)
    for seeds in ([4, 5, 6], np.array([4, 5, 6])):
        np.testing.assert_array_equal(each.reset(seed=seeds)[0], first)
    with pytest.raises(ValueError, match="3 environments need 3 seeds, got 2"):
        each.reset(seed=[1, 2])


def test_environments_keep_to_themselves_and_pass_the_collectors_check() -> None:
    task = DialTask(0.5, dims=3)
    alone, both = DialEnv(task, 1), DialEnv(task, 2)
    check_environments(both, 2)
    obs, _ = alone.reset(seed=[7])
    first, _ = both.reset(seed=[5, 7])
    for _ in range(1030):  # beyond the signs that are drawn at once
        np.testing.assert_array_equal(first[1], obs[0])
        assert set(np.unique(first)) <= {-1.0, 1.0}
        obs, reward, *_ = alone.step(0.3 * obs)
        first, rewards, over, cut, _ = both.step(0.3 * first)
        assert rewards[1] == reward[0] == pytest.approx(-0.04)
        assert over.all()
        assert not cut.any()


@pytest.mark.parametrize(
    "wrong", [{"fraction": 0.0}, {"fraction": 0.5, "cost": -1}, {"fraction": 0.5, "charged": "x"}]
)
def test_senseless_knobs_are_refused(wrong: dict) -> None:
    with pytest.raises(ValueError, match="must be"):
        DialTask(**wrong)
