"""The families and policies in JavaScript are the package's: parameters, draws, greedy actions, densities."""

import numpy as np
import pytest
import torch
from scipy import special, stats

from inbounds.book.live import export
from inbounds.book.live.in_node import run
from inbounds.learning import FAMILIES, Limits
from inbounds.learning.families.policy import Policy, PolicyConfig
from inbounds.study.grid import select
from inbounds.study.store import StudyFolder

LIMITS = {"log_std_min": -10.0, "log_std_max": 1.0, "concentration_max": 80.0}
RNG = np.random.default_rng(3)
OUTPUTS = (
    np.concatenate(  # [N, 2]: of one motor; beyond the clips, on both sides of the logit-normal's second peak
        [RNG.normal(0, 2, (60, 2)), [[0.3, 5.0], [-0.4, 1.0], [2.0, -20.0], [300.0, 0.0], [-40.0, -40.0]]]
    )
)
UNITS = np.linspace(-0.99, 0.99, 23)
NOISE = np.array([-3.5, -1.0, 0.0, 0.4, 2.9])
OF_A_LAW = """
const law = live.laws[values.family];
return values.outputs.map(([a, b]) => {
  const p = law.parameters(a, b, values.limits, 1);
  return {
    mean: law.mean(p), median: law.median(p), mode: law.mode(p), beyond: law.beyond(p),
    density: values.units.map((u) => law.density(p, u)), draws: values.noise.map((e) => law.draw(p, e)),
  };
});
"""


@pytest.mark.parametrize("family", export.NAMES)
def test_a_law_is_the_package_s(family: str) -> None:
    given = {
        "family": family,
        "outputs": OUTPUTS.tolist(),
        "limits": LIMITS,
        "units": UNITS.tolist(),
        "noise": NOISE.tolist(),
    }
    told = run(OF_A_LAW, given, engine=False)
    policy = Policy(PolicyConfig(family), -np.ones(1), np.ones(1))
    for outputs, law in zip(torch.from_numpy(OUTPUTS), told, strict=True):
        parameters = policy.parameters(outputs)
        for way in ("mean", "median", "mode"):
            ours = FAMILIES[family].greedy[way](parameters).item()
            assert law[way] == pytest.approx(ours, abs=2e-7), (outputs, way)
        public = policy.distribution(outputs)
        density = public.log_prob(torch.from_numpy(UNITS)).exp().numpy()
        np.testing.assert_allclose(law["density"], density, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(law["draws"], draws(family, parameters), atol=1e-8)
    assert Limits() == Limits(**LIMITS)


def draws(family: str, parameters: object) -> np.ndarray:
    """Unit actions for NOISE, by SciPy."""
    first, second = (x.numpy()[0] for x in parameters)  # type: ignore[attr-defined]
    if family == "beta":
        return 2 * stats.beta.ppf(stats.norm.cdf(NOISE), first, second) - 1
    z = first + np.exp(second) * NOISE
    return z if family == "gaussian" else 2 * special.expit(z) - 1


def test_the_same_noise_gives_every_family_its_own_law() -> None:
    """Kolmogorov and Smirnov find nothing in draws from parameters in the middle, and something in a wrong law."""
    code = """
    const noise = new live.Noise(7);
    const numbers = noise.normals(4000);
    const draws = {};
    for (const family of ["gaussian", "beta", "logit-normal"]) {
      const p = live.laws[family].parameters(0.5, -0.2, values, 1);
      draws[family] = numbers.map((e) => live.laws[family].draw(p, e));
    }
    return { numbers, draws };
    """
    told = run(code, LIMITS, engine=False)
    assert stats.kstest(told["numbers"], "norm").pvalue > 0.01
    assert stats.kstest(told["numbers"], "norm", args=(0.1, 1)).pvalue < 0.01
    alpha, beta = 1 + np.logaddexp(0, 0.5), 1 + np.logaddexp(0, -0.2)
    draws = {family: np.array(values) for family, values in told["draws"].items()}
    assert stats.kstest((draws["beta"] + 1) / 2, "beta", args=(alpha, beta)).pvalue > 0.01
    assert stats.kstest(2 * np.arctanh(draws["logit-normal"]), "norm", args=(0.5, np.exp(-0.2))).pvalue > 0.01
    # monotone in the same noise: the robots draw high together
    orders = [np.argsort(values) for values in draws.values()]
    assert all((order == orders[0]).all() for order in orders[1:])


@pytest.mark.parametrize("family", export.NAMES)
def test_spread_widens_a_law_about_its_mode_and_zero_stills_it(family: str) -> None:
    code = """
    const law = live.laws[values.family];
    return [0, 1, 2].map((spread) => {
      const p = law.parameters(0.6, -0.5, values.limits, spread);
      const draws = [-1, 1].map((noise) => law.draw(p, noise));
      return { mode: law.mode(p), width: draws[1] - draws[0] };
    });
    """
    still, plain, wide = run(code, {"family": family, "limits": LIMITS}, engine=False)
    assert still["width"] == pytest.approx(0, abs=1e-9)
    assert 0 < plain["width"] < wide["width"]
    if family == "beta":
        assert wide["mode"] == pytest.approx(plain["mode"])


@pytest.mark.parametrize("spread", [0, 0.05, 1])
@pytest.mark.parametrize("family", export.NAMES)
def test_the_curve_of_a_narrow_law_is_seen(family: str, spread: float) -> None:
    """Its highest computed point is near its peak, and several are not far below: a fifth of the peak, or more."""
    code = """
    const law = live.laws[values.family];
    return values.outputs.map(([a, b]) => {
      const p = law.parameters(a, b, values.limits, values.spread);
      const units = live.Densities.units(law, p);
      return { units, heights: units.map((u) => law.density(p, u)), peak: law.density(p, law.mode(p)) };
    });
    """
    outputs = [[0.31, -1.5], [-0.47, 0.0], [0.0, -3.0], [0.012, -6.0]]
    given = {"family": family, "outputs": outputs, "limits": LIMITS, "spread": spread}
    for curve in run(code, given, engine=False):
        assert curve["units"] == sorted(curve["units"])
        assert max(curve["heights"]) >= 0.99 * curve["peak"] > 0
        assert sum(height > curve["peak"] / 5 for height in curve["heights"]) >= 5


@pytest.mark.parametrize("family", export.NAMES)
def test_a_policy_acts_as_in_python(family: str) -> None:
    """Float64 sums in JavaScript, float32 in Python: they agree to a few float32 roundings."""
    (cell,) = select([f"standard-humanoid-ppo-{family}"])
    stored = next(iter(export.policies(cell, StudyFolder.shipped())))[1]
    trained = StudyFolder.shipped().load_policies(cell)[0]
    obs = trained._normalizer.mean[0] + RNG.normal(size=(20, 348)) * 0.3  # type: ignore[union-attr]
    code = """
    const policy = new live.Policy(values.stored, await live.unpack(values.stored.numbers));
    const noise = Array(policy.low.length).fill(0.3);
    return values.obs.map((obs) => {
      const parameters = policy.parameters(obs);
      const act = (way) => policy.inBox(policy.act(parameters, way, noise).executed);
      return Object.fromEntries(values.ways.map((way) => [way, act(way)]));
    });
    """
    ways = ["mean", "median", "mode", "median-snapped", "sample"]
    told = run(code, {"stored": stored, "obs": obs.tolist(), "ways": ways}, engine=False)
    for way in ways[:3]:
        np.testing.assert_allclose([each[way] for each in told], trained.act(obs, way), atol=2e-5)
    medians = trained.act(obs, "median")
    snapped = np.array([each["median-snapped"] for each in told])
    clear = np.abs(medians) > 1e-4
    np.testing.assert_array_equal(np.sign(snapped)[clear], np.sign(medians)[clear])
    np.testing.assert_allclose(np.abs(snapped), 0.4, rtol=1e-7)
    assert np.abs(np.array([each["sample"] for each in told])).max() <= np.float32(0.4)
