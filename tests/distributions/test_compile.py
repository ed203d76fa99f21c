"""The laws in one graph: torch.compile(fullgraph=True) traces them as it traces torch's own."""

from collections.abc import Callable

import pytest
import torch
from torch import Tensor
from torch.distributions import Distribution, kl_divergence

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta

LAWS = (LogitNormal, ClippedNormal, ScaledBeta)
LOW, HIGH = torch.tensor([-2.0, 0.0]), torch.tensor([1.0, 0.4])
READ = {
    "density": lambda law: law.log_prob((LOW + HIGH) / 2 + 0.1),
    "density of the latent": lambda law: law.log_prob_latent(torch.tensor([0.3, 0.2])),
    "entropy": lambda law: law.entropy(),
    "mean": lambda law: law.mean,
    "variance": lambda law: law.variance,
    "mode": lambda law: law.mode,
    "sample": lambda law: law.rsample(),
}


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_made_and_read_in_one_graph(law: type[Distribution], checked: bool) -> None:
    first, second = torch.tensor([[1.3, 2.0]]), torch.tensor([[1.5, 1.1]])

    def read(first: Tensor, second: Tensor) -> dict[str, Tensor]:
        made = law(first, second, LOW, HIGH, validate_args=checked)
        return {name: look(made) for name, look in READ.items()}

    torch._dynamo.reset()
    torch.manual_seed(0)
    expected = read(first, second)
    torch.manual_seed(0)
    found = torch.compile(read, fullgraph=True, backend="eager")(first, second)
    for name in READ:
        assert torch.allclose(found[name], expected[name], rtol=1e-6), name


@pytest.mark.parametrize("law", LAWS)
def test_a_gradient_is_compiled_too(law: type[Distribution]) -> None:
    second = torch.tensor([[1.5, 1.1]])

    def loss(first: Tensor) -> Tensor:
        made = law(first, second, LOW, HIGH)
        return (made.log_prob_latent(torch.tensor([0.3, 0.2])) + made.entropy()).sum()

    def gradient(function: Callable[[Tensor], Tensor]) -> Tensor:
        first = torch.tensor([[1.3, 2.0]], requires_grad=True)
        (found,) = torch.autograd.grad(function(first), first)
        return found

    torch._dynamo.reset()
    compiled = torch.compile(loss, fullgraph=True, backend="aot_eager")
    assert torch.allclose(gradient(compiled), gradient(loss), rtol=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_a_divergence_is_compiled(law: type[Distribution], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for the first time: what torch remembers of the functions that it has looked up is forgotten before."""
    first, second = torch.tensor([[1.3, 2.0]]), torch.tensor([[1.5, 1.1]])

    def divergence(first: Tensor, second: Tensor) -> Tensor:
        return kl_divergence(law(first, second, LOW, HIGH), law(second, first, LOW, HIGH))

    expected = divergence(first, second)
    monkeypatch.setattr(torch.distributions.kl, "_KL_MEMOIZE", {})
    torch._dynamo.reset()
    found = torch.compile(divergence, fullgraph=True, backend="eager")(first, second)
    assert torch.allclose(found, expected)
