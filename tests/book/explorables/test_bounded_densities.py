"""The explorables' mathematics in JavaScript agrees with the package and SciPy; their HTML is fixed and self-contained.

Node runs the scripts: the one that comes with Playwright, so that no other need be installed. How an explorable
behaves in a page is tested in tests/pages.
"""

import itertools
import json
import re
import subprocess
from collections.abc import Mapping
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import torch
from bokeh.models import ColumnDataSource
from playwright._impl._driver import compute_driver_executable
from scipy import integrate, special, stats

from inbounds.book.drawing import figures
from inbounds.book.explorables import frame
from inbounds.book.explorables.bounded_densities import MatchedLaws, bounded_densities
from inbounds.book.explorables.frame import javascript_files
from inbounds.distributions import LogitNormal

SCRIPTS = [path for path in javascript_files() if "bokeh" not in path.name and path.name != "shell.js"]
RNG = np.random.default_rng(7)
# Corners of the sliders, both sides of the bimodality condition, and points in between.
LATENTS = [
    *[(mu, log_sigma) for mu in (-4.0, 0.0, 4.0) for log_sigma in (-3.0, 0.3, 0.4, 1.0)],
    (1.0, 1.0),  # a peak so near a bound that three digits would put it there
    *zip(RNG.uniform(-4, 4, 20).tolist(), RNG.uniform(-3, 1, 20).tolist(), strict=True),
]


def run_js(expression: str, **values: Any) -> Any:
    """The value of a JavaScript expression, in which `values` are variables."""
    load = "".join(path.read_text(encoding="utf-8") for path in SCRIPTS)
    constants = "".join(f"const {name} = {json.dumps(value)};" for name, value in values.items())
    code = f"{load};{{{constants}\nconst {{ {', '.join(NUMERICS)} }} = inbounds.numerics;\n"
    code += f"console.log(JSON.stringify({expression}))}}"
    node = compute_driver_executable()[0]
    done = subprocess.run([node, "-"], input=code, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


NUMERICS = (
    "normalCdf",
    "logGamma",
    "betaCdf",
    "expectation",
    "logitNormal",
    "clippedGaussian",
    "matchedBeta",
)


@pytest.fixture(scope="module")
def states() -> list[dict[str, Any]]:
    """What the page shows, for all of LATENTS."""
    model = 'inbounds.models["bounded-densities"]'
    return run_js(f"points.map(([mu, log_sigma]) => {model}({{ mu, log_sigma }}))", points=LATENTS)  # type: ignore[no-any-return]


def test_normal_cdf() -> None:
    x = np.linspace(-12, 12, 201)
    np.testing.assert_allclose(run_js("x.map(normalCdf)", x=x.tolist()), stats.norm.cdf(x), atol=4e-15)


def test_log_gamma() -> None:
    x = np.concatenate([np.geomspace(1e-3, 1e5, 200), [1.0, 2.0, 11.999, 12.0]])
    np.testing.assert_allclose(
        run_js("x.map(logGamma)", x=x.tolist()), special.gammaln(x), rtol=1e-13, atol=3e-14
    )


def test_beta_cdf() -> None:
    a, b = np.meshgrid([0.3, 1.0, 2.5, 40.0, 3e4], [0.4, 1.0, 7.0, 500.0])
    x = stats.beta.ppf(np.array([0.0, 1e-6, 0.1, 0.5, 0.97, 1.0])[:, None, None], a, b)
    cases = np.stack(np.broadcast_arrays(x, a, b), -1).reshape(-1, 3)
    ours = run_js("cases.map(([x, a, b]) => betaCdf(x, a, b))", cases=cases.tolist())
    np.testing.assert_allclose(
        ours, special.betainc(cases[:, 1], cases[:, 2], cases[:, 0]), rtol=2e-9, atol=1e-12
    )


def test_expectation_is_exact_for_polynomials() -> None:
    moments = run_js("[0, 1, 2, 4].map((n) => expectation((z) => z ** n, 1, 2))")
    np.testing.assert_allclose(moments, [1.0, 1.0, 5.0, 73.0], rtol=1e-12)  # E[z⁴] = 1 + 6·4 + 3·16


def test_logit_normal_agrees_with_the_package(states: list[dict[str, Any]]) -> None:
    for (mu, log_sigma), state in zip(LATENTS, states, strict=True):
        law = LogitNormal(*torch.tensor([mu, np.exp(log_sigma)], dtype=torch.float64), low=-1.0, high=1.0)
        js = state["laws"]["logit-normal"]
        for name, expected in (("mean", law.mean), ("std", law.stddev), ("median", law.median)):
            np.testing.assert_allclose(
                js[name], float(expected), rtol=1e-10, atol=1e-12, err_msg=f"{name} {mu, log_sigma}"
            )
        assert len(js["modes"]) == (2 if law.is_bimodal else 1)
        if mu:  # at μ = 0 the two modes tie
            assert min(abs(mode - float(law.mode)) for mode in js["modes"]) < 1e-9
        curve = state["sources"]["logit-normal"]
        x = torch.tensor(curve["x"][1:-1], dtype=torch.float64)
        np.testing.assert_allclose(curve["y"][1:-1], law.log_prob(x).exp().numpy(), rtol=1e-8, atol=1e-12)
        assert curve["y"][0] == curve["y"][-1] == 0


def test_clipped_gaussian_agrees_with_quadrature(states: list[dict[str, Any]]) -> None:
    for (mu, log_sigma), state in zip(LATENTS, states, strict=True):
        m, s = MatchedLaws(mu, float(np.exp(log_sigma))).gaussian
        js = state["laws"]["gaussian"]
        np.testing.assert_allclose(
            [js["atLow"], js["atHigh"]], [stats.norm.cdf(-1, m, s), stats.norm.sf(1, m, s)], atol=1e-14
        )

        def clipped(power: int, m: float = m, s: float = s) -> float:
            breaks = np.clip([-1.0, m - 8 * s, m - s, m, m + s, m + 8 * s, 1.0], -1.0, 1.0)
            parts = [
                integrate.quad(lambda x: x**power * stats.norm.pdf(x, m, s), a, b)[0]
                for a, b in itertools.pairwise(breaks)
            ]
            return sum(parts) + (-1) ** power * stats.norm.cdf(-1, m, s) + stats.norm.sf(1, m, s)

        np.testing.assert_allclose(js["mean"], clipped(1), rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(js["std"] ** 2, clipped(2) - clipped(1) ** 2, rtol=1e-5, atol=1e-12)
        assert js["median"] == pytest.approx(m)
        assert js["modes"] == [pytest.approx(m)]


def test_beta_has_the_same_mean_and_spread(states: list[dict[str, Any]]) -> None:
    proper = 0
    for (mu, log_sigma), state in zip(LATENTS, states, strict=True):
        alpha, beta = MatchedLaws(mu, float(np.exp(log_sigma))).beta
        js, target = state["laws"]["beta"], state["laws"]["logit-normal"]
        np.testing.assert_allclose([js["alpha"], js["beta"]], [alpha, beta], rtol=1e-7)
        oracle = stats.beta(js["alpha"], js["beta"], loc=-1.0, scale=2.0)
        np.testing.assert_allclose(
            [oracle.mean(), oracle.std()], [target["mean"], target["std"]], rtol=1e-8, atol=1e-12
        )
        assert js["median"] == pytest.approx(oracle.median(), abs=1e-8)
        assert js["proper"] == (min(alpha, beta) > 1)
        curve = state["sources"]["beta"]
        if js["proper"]:
            proper += 1
            np.testing.assert_allclose(curve["y"], oracle.pdf(curve["x"]), rtol=1e-7, atol=1e-12)
            np.testing.assert_allclose(oracle.pdf(js["modes"][0]), max(curve["y"]), rtol=5e-3)
        else:
            assert curve == {"x": [], "y": []}
            assert "No Beta" in state["note"]
            assert state["table"]["mean"][1] == "–"
    assert 0 < proper < len(LATENTS)


def test_gaussian_is_the_tangent_of_the_squash() -> None:
    """As σ → 0 the two have the same mean and spread, to first order."""
    for mu in (-2.0, 0.0, 1.5):
        laws = MatchedLaws(mu, 0.01)
        m, s = laws.gaussian
        assert float(laws.logit_normal.mean) == pytest.approx(m, abs=1e-4)
        assert float(laws.logit_normal.stddev) == pytest.approx(s, rel=1e-3)


def test_every_curve_and_its_atoms_weigh_one(states: list[dict[str, Any]]) -> None:
    for point, state in zip(LATENTS, states, strict=True):
        for family in ("gaussian", "beta", "logit-normal"):
            x, y = np.array(state["sources"][family]["x"]), np.array(state["sources"][family]["y"])
            if not x.size:
                continue
            assert (np.diff(x) > 0).all()
            assert np.isfinite(y).all()
            assert y.max() < state["ranges"]["density"][1]
            law = state["laws"][family]
            assert integrate.trapezoid(y, x) + law["atLow"] + law["atHigh"] == pytest.approx(1, abs=2e-3), (
                family,
                point,
            )


def test_table_and_note_say_what_the_laws_say(states: list[dict[str, Any]]) -> None:
    explorable = bounded_densities()
    for state in states:
        law = state["laws"]["gaussian"]
        atoms = state["sources"]["atoms"]
        assert atoms["mass"] == [law["atLow"], law["atHigh"]]
        for mass, row in zip(atoms["mass"], ("at_low", "at_high"), strict=True):
            if mass > 0.001:
                assert float(state["table"][row][0].removesuffix(" %")) == pytest.approx(
                    100 * mass, abs=0.051
                )
        assert set(state["table"]) == set(explorable.rows)
        assert {len(cells) for cells in state["table"].values()} == {len(explorable.columns)}
        assert ("two peaks" in state["note"]) == (len(state["laws"]["logit-normal"]["modes"]) == 2)
        assert float(state["table"]["std"][0]) == pytest.approx(law["std"], abs=6e-4)
        assert not re.search(
            r"\b1\.0+\b", state["note"] + state["table"]["modes"][2]
        )  # a peak is never at a bound


class Page(HTMLParser):
    """The tags of a piece of HTML."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def all(self, tag: str) -> list[Mapping[str, str | None]]:
        return [attrs for name, attrs in self.tags if name == tag]


def test_book_page_holds_no_script_but_data() -> None:
    html = bounded_densities().html(live=False)
    page = Page(html)
    assert 'class="inbounds-explorable"' in html  # by which the build finds the pages that need BokehJS
    assert "--inbounds-plots: 320px; --inbounds-controls: 2" in html  # the room that the page keeps for it
    assert [script.get("type") for script in page.all("script")] == ["application/json"]
    assert len(html) < 120_000
    assert not re.findall(r"https?://", html)
    (image,) = page.all("img")
    assert image["alt"] == bounded_densities().alt
    assert (image["src"] or "").startswith("data:image/svg+xml,")
    assert len(page.all("tr")) == 9


def test_live_notebook_brings_the_scripts_along(monkeypatch: pytest.MonkeyPatch) -> None:
    explorable = bounded_densities()
    monkeypatch.delenv("INBOUNDS_BOOK_BUILD", raising=False)
    live = explorable._repr_mimebundle_()["text/html"]
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", "1")
    book = explorable._repr_mimebundle_()["text/html"]
    assert [script.get("type") for script in Page(live).all("script")] == ["application/json", None]
    code = live[live.rindex("<script>") + len("<script>") : live.rindex("</script>")]
    assert "</script" not in code
    (sources,) = re.findall(r"\}\)\((\[.*\])\)$", code, flags=re.DOTALL)
    assert json.loads(sources) == [path.read_text(encoding="utf-8") for path in javascript_files()]
    assert book == explorable.html(live=False)


def test_output_does_not_depend_on_what_was_drawn_before() -> None:
    first = bounded_densities()
    ColumnDataSource()  # takes one of Bokeh's ids
    second = bounded_densities()
    assert first.html(live=False) == second.html(live=False)
    assert repr(first) == repr(second)
    assert repr(first).startswith("Explorable: three policies")
    item = json.loads(
        re.findall(r'application/json">(.*?)</script>', first.html(live=False), flags=re.DOTALL)[0]
    )
    ids = re.findall(r'"(?:id|root_id)": "([^"]*)"', json.dumps(item))
    assert all(name.startswith("bounded-densities-") for name in ids)
    assert item["root_id"] == item["doc"]["roots"][0]["id"]


def test_initial_values_are_the_sliders() -> None:
    explorable = bounded_densities(mu=-0.5, sigma=2.0)
    mu, log_sigma = explorable.controls
    assert (mu.value, np.exp(log_sigma.value)) == (-0.5, pytest.approx(2.0))
    assert "μ = -0.5, σ = 2" in explorable.alt
    # m = tanh(-0.25), s = 1 - m²: 21.1 % below -1, 9.3 % above 1
    assert "21.1% of its actions on the lower and 9.3% on the upper" in explorable.alt


@pytest.mark.parametrize(("mu", "sigma"), [(5.0, 1.0), (0.0, 3.0), (0.0, 0.0), (0.0, -1.0)])
def test_values_outside_the_sliders_are_refused(mu: float, sigma: float) -> None:
    with pytest.raises(ValueError, match="choose mu in"):
        bounded_densities(mu, sigma)


def test_static_figure_shows_the_same_curves() -> None:
    fig = bounded_densities(mu=0.3, sigma=1.0).fallback()
    labels = [line.get_label() for line in fig.axes[0].lines]
    assert labels == [figures.LOOKS[family].label for family in ("gaussian", "beta", "logit-normal")]
    state = run_js('inbounds.models["bounded-densities"]({ mu: 0.3, log_sigma: 0 })')
    for line, family in zip(fig.axes[0].lines, ("gaussian", "beta", "logit-normal"), strict=True):
        x, y = line.get_data()
        source = state["sources"][family]
        np.testing.assert_allclose(np.interp(x, source["x"], source["y"]), y, atol=2e-3 * y.max())
    bars = [bar.get_height() for bar in fig.axes[1].patches]
    np.testing.assert_allclose(bars, state["sources"]["atoms"]["mass"], atol=1e-12)


def test_static_figure_leaves_out_an_improper_beta() -> None:
    fig = bounded_densities(mu=0.0, sigma=2.5).fallback()
    assert [line.get_label() for line in fig.axes[0].lines] == ["Gaussian, clipped", "Logit-normal"]


def test_scripts_exist_and_bokeh_comes_first() -> None:
    paths = javascript_files()
    assert all(path.is_file() for path in paths)
    names = [path.name for path in paths]
    assert names[:3] == ["bokeh.min.js", "bokeh-widgets.min.js", "numerics.js"]
    assert names[-1] == "shell.js"
    assert len(set(names)) == len(names), "the build copies them into one folder"


def test_an_explorable_needs_its_model() -> None:
    with pytest.raises(ValueError, match=r"add no_such\.js"):
        frame.Explorable("no-such", "", "", (), (), {}, {}, figures.beta_densities)
