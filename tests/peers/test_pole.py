"""Two exercises' answers that take minutes: what is stored comes out again, as far as one batch shows it."""

import json
from types import ModuleType
from typing import Any

import pytest
import torch

from benchmarks import pole


@pytest.fixture(scope="module")
def stored() -> dict[str, Any]:
    """What the solutions read."""
    found: dict[str, Any] = json.loads(pole.TARGET.read_text(encoding="utf8"))
    return found


def test_ten_seeds_of_forty_batches_are_stored(stored: dict[str, Any]) -> None:
    assert list(stored["lambda"]) == [f"{lam:g}" for lam in pole.LAMBDAS]
    assert {len(runs) for runs in stored["lambda"].values()} == {10}
    assert {len(run) for runs in stored["lambda"].values() for run in runs} == {pole.EPOCHS}
    assert stored["first_without_a_fall"] == {
        lam: [pole.first_without_a_fall(run) for run in runs] for lam, runs in stored["lambda"].items()
    }
    assert len(stored["batches"]) == 10
    assert {len(batch[name]) for batch in stored["batches"] for name in ("own", "shuffled")} == {
        len(pole.STEPS)
    }


@pytest.mark.parametrize("seed", [0, 7])
def test_the_first_batch_comes_out_again(
    stored: dict[str, Any], seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the seed and the robot: the first batch is drawn before λ has a say."""
    monkeypatch.setattr(pole, "EPOCHS", 1)
    again = [pole.points_by_lambda(lam, seed) for lam in pole.LAMBDAS]
    assert again == [runs[seed][:1] for runs in stored["lambda"].values()]


def test_lambda_reaches_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pole, "EPOCHS", 8)
    assert pole.points_by_lambda(0.0, 0) != pole.points_by_lambda(0.95, 0)


def test_a_policy_that_never_holds_has_no_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pole, "EPOCHS", 0)
    assert pole.falls_after_steps(0) == {"batches": None}


def test_a_policy_that_holds_is_tried_on_its_own_batch_and_a_shuffled_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In three steps the pole does not fall: the first batch will do."""
    weights: list[torch.Tensor] = []
    of_chapter = pole.program

    def watched(chapter: str) -> ModuleType:
        module = of_chapter(chapter)
        surrogate = module.surrogate

        def watch(policy: Any, batch: Any, weight: torch.Tensor, before: torch.Tensor) -> torch.Tensor:
            weights.append(weight)
            found: torch.Tensor = surrogate(policy, batch, weight, before)
            return found

        vars(module)["surrogate"] = watch
        return module

    monkeypatch.setattr(pole, "program", watched)
    monkeypatch.setattr(pole, "HORIZON", 3)
    monkeypatch.setattr(pole, "STEPS", (0, 2))
    falls = pole.falls_after_steps(2)
    assert falls["batches"] == 0
    assert len(falls["own"]) == len(falls["shuffled"]) == 2
    own, _, shuffled, _ = weights  # two steps each
    assert abs(float(own.mean())) < 1e-6
    assert not torch.equal(own, shuffled)
    assert torch.equal(own.sort().values, shuffled.sort().values)
