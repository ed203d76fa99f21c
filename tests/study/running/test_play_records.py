"""What records keep of trained policies' latents: against fifty digits, and never more than the record alone loses."""

import dataclasses
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import torch

from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import run_cell
from inbounds.study.running import play_records
from inbounds.study.running.play_records import RECORDS, publish_records, read_records, records_of
from tests.study.running.test_play_ways import cell_of, short_episodes  # noqa: F401 (a fixture that applies itself)
from tests.study.small import folder_in

BITS = {"action, float64": 53, "action, float32": 24, "action, float16": 11, "action, bfloat16": 8}


@pytest.mark.parametrize("name", BITS)
def test_a_record_is_the_nearest_number_of_its_format(name: str) -> None:
    mpmath.mp.dps = 50
    for latent in (0.7, 3.1, 5.0, 9.5):
        spacing = mpmath.mpf(2) ** -BITS[name]
        k = int(mpmath.nint(2 / (1 + mpmath.exp(latent)) / spacing)) if latent > np.log(3) else None
        found = RECORDS[name].recalled(torch.tensor([latent, -latent], dtype=torch.float64))  # type: ignore[union-attr]
        assert found[0] == -found[1]
        if k:
            assert float(found[0]) == pytest.approx(
                float(mpmath.log((2 - k * spacing) / (k * spacing))), rel=1e-8
            )


def test_what_is_lost_is_what_is_stored_as_the_bound() -> None:
    latents = torch.tensor([18.0, 18.1, -18.1, 60.0], dtype=torch.float64)  # lost from 26 log 2 = 18.02 on
    assert RECORDS["action, float32"].lost(latents) == 3  # type: ignore[union-attr]
    assert RECORDS["action, float64"].lost(latents) == 1  # type: ignore[union-attr]


def test_the_files_rows_are_the_policies(tmp_path: Path) -> None:
    cell, folder = cell_of("logit-normal"), folder_in(tmp_path)
    run_cell(cell, folder)
    assert publish_records([cell, cell_of("gaussian")], folder)
    assert not publish_records([cell], folder)
    other = dataclasses.replace(cell, algorithm="trpo")
    run_cell(other, folder)
    assert publish_records([other], folder)  # what was there stays
    assert read_records(folder).keys() == {cell.id, other.id}
    kinds = read_records(folder)[cell.id]
    assert kinds.keys() == RECORDS.keys()
    assert (kinds["latent, float32"]["worst"] == 0).all()  # a policy in float32 draws latents in float32
    assert (kinds["action, bfloat16"]["wrong"] > kinds["action, float16"]["wrong"]).all()
    rows = [row for row in records_of(cell, folder) if row["record"] == "action, bfloat16"]
    again = folder.policy_files(cell)[0]
    again.write_bytes(folder.policy_files(other)[0].read_bytes())
    with pytest.raises(
        DamagedFileError, match=f"is of other policies than {again}: .*inbounds study evaluate"
    ):
        read_records(folder)
    assert publish_records([cell, other], folder)  # whose policies have been replaced
    assert not publish_records([cell, other], folder)
    assert read_records(folder).keys() == {cell.id, other.id}
    assert [row["wrong"] for row in rows] == kinds["action, bfloat16"]["wrong"].tolist()
    assert [row["steps"] for row in rows] == [40, 40]
    again.unlink()
    with pytest.raises(DamagedFileError, match=f"{again} is missing: restore it"):
        read_records(folder)


def test_a_ratio_that_is_no_number_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second seed's policy gives no numbers: none of its steps counts as recalled."""

    class Diverged:
        def __init__(self, _: Any) -> None:
            noise = np.random.default_rng(0).normal(size=(7, 2, 3)).astype(np.float32)  # [T, S, A]
            law = np.stack([np.zeros_like(noise), np.ones_like(noise)])
            noise[:, 1], law[:, :, 1] = np.nan, np.nan
            self.latents, self.laws = list(noise), [list(step) for step in law.swapaxes(0, 1)]

        def play(self, *_: Any) -> Any:
            return np.zeros((2, 1)), np.full((2, 1), 7)

        def close(self) -> None: ...

    monkeypatch.setattr(play_records, "run_with_policies", lambda *_: None)
    monkeypatch.setattr(play_records, "_Recorder", Diverged)
    rows = records_of(cell_of("logit-normal"), folder_in(tmp_path))
    assert [row["wrong"] for row in rows if row["seed"] == 1] == [1.0] * len(RECORDS)
    (whole,) = [row["wrong"] for row in rows if (row["seed"], row["record"]) == (0, "latent, float32")]
    assert whole == 0.0
