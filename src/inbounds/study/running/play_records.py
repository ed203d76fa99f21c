"""What a buffer that stores actions would have kept of the latents that the trained logit-normal policies draw.

    results/evaluations/records.parquet   one row per cell, seed and kind of record; `SCHEMA` says what it means

Each policy plays one episode with its noise, from the first start of its final evaluation. Every latent z is put on
record as the action tanh(z/2), rounded to a format, and computed back; the ratio at unchanged parameters, which should
be 1, is then exp of the difference of two log-densities, both in float64, so that the record alone is to blame.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import torch
from numpy.typing import NDArray
from torch import Tensor

from inbounds.learning.families import NORMAL
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import store
from inbounds.study.grid import STUDY_VERSION, Cell
from inbounds.study.running.evaluate import FINAL, Players, generator_of
from inbounds.study.running.play_ways import final_starts, run_with_policies
from inbounds.study.running.provenance import provenance
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import of_others

Floats = NDArray[np.float64]
OFF = 0.01
"""A ratio further from 1 than this is called wrong."""


class Record(NamedTuple):
    """A way to store an action."""

    dtype: torch.dtype
    """Format of the number."""
    edge: float
    """The largest action that is read back; below 1, so that every latent is finite."""

    def recalled(self, latent: Tensor) -> Tensor:
        """Return what it gives back of latents in float64.

        Example:
            >>> record = Record(torch.float32, 1 - 2.0**-24)
            >>> round(record.recalled(torch.tensor([30.0]).double()).item(), 6)  # not 30: the action is the bound
            17.328679
        """
        return 2 * torch.atanh(self._stored(latent).clamp(-self.edge, self.edge))

    def lost(self, latent: Tensor) -> int:
        """Return how many actions are stored as the bound itself, which no latent belongs to."""
        return int((self._stored(latent).abs() == 1).sum())

    def _stored(self, latent: Tensor) -> Tensor:
        return torch.tanh(latent / 2).to(self.dtype).double()


RECORDS: Mapping[str, Record | None] = MappingProxyType(
    {
        "latent, float32": None,
        "action, float64": Record(torch.float64, 1 - 2.0**-53),
        "action, float32": Record(torch.float32, 1 - 2.0**-24),
        "action, float32, ±(1 − 1e-6)": Record(torch.float32, 1 - 1e-6),
        "action, float16": Record(torch.float16, 1 - 2.0**-11),
        "action, bfloat16": Record(torch.bfloat16, 1 - 2.0**-8),
    }
)
"""What is stored; None is the latent itself, in single precision."""

SCHEMA = pa.schema(
    [
        pa.field(name, kind, nullable=False, metadata={"meaning": meaning})
        for name, kind, meaning in (
            ("cell", pa.string(), "whose policies"),
            ("seed", pa.int32(), "the seed that was trained"),
            ("record", pa.string(), "what is stored: a key of `RECORDS`"),
            ("steps", pa.int32(), "env steps of the episode"),
            (
                "wrong",
                pa.float64(),
                f"share of steps whose ratio at unchanged parameters is off by more than {OFF:.0%}",
            ),
            (
                "lost",
                pa.int32(),
                "action components, of steps times motors, that are stored as a bound itself",
            ),
            ("worst", pa.float64(), "largest absolute logarithm of that ratio"),
            ("abs_latent_q50", pa.float64(), "median of |z| over steps and motors"),
            ("abs_latent_q99", pa.float64(), "99 % quantile of |z|"),
            ("abs_latent_max", pa.float64(), "largest |z|"),
        )
    ]
)


class _Recorder(Players):
    """Players who keep what they draw, and from which law."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.latents: list[NDArray[Any]] = []
        self.laws: list[list[NDArray[Any]]] = []

    def _act(self, obs: NDArray[Any], way: str, generators: Sequence[np.random.Generator]) -> NDArray[Any]:
        policy, outputs = self.trainer.networks.policy, self._outputs(obs).numpy()
        parameters = policy.parameters(outputs, np)
        latent = policy.law.sampler(generators, 1, policy.act_dim, outputs.dtype)(parameters, 0)
        self.latents.append(latent)
        self.laws.append(list(parameters))
        return policy.execute(latent, self.trainer.collector.action_mode)


def records_of(cell: Cell, folder: StudyFolder) -> list[dict[str, Any]]:
    """Return the rows of a cell whose latents are Normal and whose map is the sigmoid.

    Args:
        cell: of the family `logit-normal`.
        folder: where its policies are.

    Example:
        >>> from inbounds.study import select
        >>> cell, = select(["standard-swimmer-trpo-logit-normal"])
        >>> rows = records_of(cell, StudyFolder())  # in the project's folder
        >>> len(rows), rows[0]["record"], rows[0]["wrong"]
        (60, 'latent, float32', 0.0)
    """
    seeds = cell.kept_seeds
    starts = [int(final_starts(seed)[0]) for seed in seeds]
    with closing(_Recorder(run_with_policies(cell, folder))) as players:
        _, lengths = players.play("sample", starts, [generator_of(seed, FINAL + 1) for seed in seeds])
    latents = np.stack(players.latents, 1).astype(np.float64)  # [S, T, A]
    laws = [np.stack(each, 1).astype(np.float64) for each in zip(*players.laws, strict=True)]
    rows = []
    for s, seed in enumerate(seeds):
        length = int(lengths[s, 0])
        z = torch.from_numpy(latents[s, :length])
        law = NORMAL.named(*(torch.from_numpy(each[s, :length]) for each in laws))
        size = z.abs().numpy()
        about = {
            "cell": cell.id,
            "seed": seed,
            "steps": length,
            "abs_latent_q50": float(np.quantile(size, 0.5)),
            "abs_latent_q99": float(np.quantile(size, 0.99)),
            "abs_latent_max": float(size.max()),
        }
        for name, record in RECORDS.items():
            recalled = z.float().double() if record is None else record.recalled(z)
            log_ratio = NORMAL.log_prob(law, recalled) - NORMAL.log_prob(law, z)
            wrong = float((~(torch.expm1(log_ratio).abs() <= OFF)).double().mean())  # NaN is wrong
            lost = 0 if record is None else record.lost(z)
            more = {"wrong": wrong, "lost": lost, "worst": float(log_ratio.abs().max())}
            rows.append(about | {"record": name} | more)
    return rows


def publish_records(cells: Sequence[Cell], folder: StudyFolder) -> bool:
    """Add the records of every logit-normal cell among some that ships its policies, unless they are there.

    Returns:
        Whether anything had to be done.
    """
    mine = [
        c
        for c in cells
        if c.family == "logit-normal" and c.keeps_policies and folder.policy_files(c)[0].is_file()
    ]
    path = records_file(folder)
    kept, policies = [], {}
    if path.is_file():
        kept, policies = store.read_cell(path).to_pylist(), store.read_metadata(path, "policies")["policies"]
    new = [cell for cell in mine if policies.get(cell.id) != store.sha256(folder.policy_files(cell)[0])]
    if not new:
        return False
    stale = {cell.id for cell in new}  # of policies that have been replaced
    kept = [row for row in kept if row["cell"] not in stale]
    rows = kept + [row for cell in new for row in records_of(cell, folder)]
    policies |= {cell.id: store.sha256(folder.policy_files(cell)[0]) for cell in new}
    about = {"study_version": STUDY_VERSION, "id": "records", "config": {}, "policies": policies}
    metadata = json.dumps(about | {"session": provenance()})
    folder.publish({path: parquet_bytes(pa.Table.from_pylist(rows, SCHEMA), metadata)})
    return True


def records_file(folder: StudyFolder) -> Path:
    """Return the path of the records."""
    return folder.results / "evaluations" / "records.parquet"


def read_records(folder: StudyFolder) -> dict[str, dict[str, dict[str, Floats]]]:
    """Read what records keep: by cell and kind of record, each column as `[S]`.

    Raises:
        FileNotFoundError: there are none.
        DamagedFileError: the file is damaged, or of other policies than those that are there.

    Example:
        >>> records = read_records(StudyFolder())  # in the project's folder
        >>> records["standard-ant-ppo-logit-normal"]["latent, float32"]["wrong"].max().item()
        0.0
    """
    path = records_file(folder)
    table, played = store.read_cell(path), store.read_metadata(path, "policies")["policies"]
    names = [name for name in SCHEMA.names if name not in ("cell", "seed", "record")]
    found: dict[str, dict[str, dict[str, list[float]]]] = {}
    for row in table.to_pylist():
        kinds = found.setdefault(row["cell"], {}).setdefault(row["record"], {name: [] for name in names})
        for name in names:
            kinds[name].append(row[name])
    for cell in found:
        policies = folder.results / "policies" / f"{cell}.safetensors"
        if said := of_others(path, policies, played.get(cell, "")):
            raise DamagedFileError(said)
    return {
        cell: {record: {n: np.array(v) for n, v in columns.items()} for record, columns in kinds.items()}
        for cell, kinds in found.items()
    }
