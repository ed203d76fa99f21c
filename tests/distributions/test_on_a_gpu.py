"""The laws where their parameters live: on a GPU they say what they say on a CPU, and leave nothing behind there."""

from typing import Any

import numpy as np
import pytest
import torch
from torch.distributions import kl_divergence

from .families import FAMILIES, Family

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch can use")

LOW, HIGH = np.array([-1.0, -2.0, 0.0], np.float32), np.array([1.0, 5.0, 0.5], np.float32)
SHAPE = (500, 3)
BOUNDS = {
    "numbers": (-1.0, 2.0),
    "arrays": (LOW, HIGH),
    "tensors": (torch.from_numpy(LOW), torch.from_numpy(HIGH)),
}


@pytest.fixture(params=FAMILIES.values(), ids=FAMILIES.keys())
def family(request: pytest.FixtureRequest) -> Family:
    return request.param


@pytest.fixture(params=BOUNDS.values(), ids=BOUNDS.keys())
def bounds(request: pytest.FixtureRequest) -> tuple[Any, Any]:
    return request.param


def told(law: Any, other: Any, latent: torch.Tensor) -> dict[str, torch.Tensor]:
    """Everything that a law says, in its latent, its action, and by itself."""
    value = law.latent_to_value(latent)
    said = {
        name: getattr(law, name)
        for name in (
            "mean",
            "variance",
            "median",
            "mode",
            "mode_latent",
            "is_bimodal",
            "mass_low",
            "mass_high",
        )
        if hasattr(law, name)
    }
    said |= {"value": value, "entropy": law.entropy(), "kl": kl_divergence(law, other)}
    said |= {"log_prob": law.log_prob(value), "log_prob_latent": law.log_prob_latent(latent)}
    if type(law).cdf is not torch.distributions.Distribution.cdf:
        said["cdf"] = law.cdf(value)
        said["icdf"] = law.icdf(torch.full(SHAPE, 0.3, dtype=latent.dtype, device=latent.device))
    return said


@pytest.mark.parametrize(("dtype", "error"), [(torch.float64, 1e-9), (torch.float32, 2e-4)])
def test_a_law_says_the_same(
    family: Family, bounds: tuple[Any, Any], dtype: torch.dtype, error: float
) -> None:
    parameters = [p.to(dtype) for p in (*family.parameters(SHAPE), *family.parameters(SHAPE, 1))]
    latent = family.law(*parameters[:2], *bounds).rsample_latent()
    said, slopes = {}, {}
    for device in "cpu", "cuda":
        own = [p.detach().to(device).requires_grad_() for p in parameters]
        law, other = family.law(*own[:2], *bounds), family.law(*own[2:], *bounds)
        said[device] = told(law, other, latent.to(device))
        total = sum(part.sum() for part in said[device].values() if part.requires_grad)
        slopes[device] = torch.autograd.grad(total, own)
    assert all(part.device.type == "cuda" for part in (*said["cuda"].values(), *slopes["cuda"]))
    for name, expected in said["cpu"].items():
        found = said["cuda"][name].cpu()
        torch.testing.assert_close(found, expected, rtol=error, atol=error, msg=lambda m, n=name: f"{n}: {m}")
    for found, expected in zip(slopes["cuda"], slopes["cpu"], strict=True):
        scale = expected.abs().max().item()
        torch.testing.assert_close(found.cpu(), expected, rtol=error, atol=error * scale)


def test_a_law_draws_there(family: Family, bounds: tuple[Any, Any]) -> None:
    law = family.law(*(p.cuda() for p in family.parameters(SHAPE)), *bounds)
    drawn = law.rsample((400,), torch.Generator("cuda").manual_seed(3))
    assert drawn.device.type == "cuda"
    assert bool(law.support.check(drawn).all())
    again = law.rsample((400,), torch.Generator("cuda").manual_seed(3))
    assert torch.equal(drawn, again)
    error = (drawn.mean(0) - law.mean) / (law.variance / 400).sqrt()
    assert error.square().mean().item() == pytest.approx(1, abs=0.2)  # 1500 means: five standard errors
