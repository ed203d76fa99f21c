"""What a run leaves on disk, beside the checkpoint it goes on from: learning curves and policies.

`curves.parquet` has one row per epoch and seed; `COLUMNS` is its schema. `policies.safetensors` has the weights of
every seed's policy network, the statistics its observations are normalised by, and the box of its actions. Both carry
the run's whole configuration as JSON, hold no code (nothing is unpickled), are written whole or not at all, and have
checksums, so that damage is noticed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from inbounds.learning.config import TrainConfig
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.parquet import about_of, parquet_bytes, read_table
from inbounds.learning.storage.run_metadata import METADATA_KEY, config_from, metadata_of, parsed
from inbounds.learning.storage.stored_config import describe
from inbounds.learning.storage.trained_policy import TrainedPolicy, policies_from
from inbounds.learning.storage.whole_files import damaged, find, says_nothing_of_the_file, write_whole

CHECKPOINT_FILE = checkpoint.FILE_NAME
CURVES_FILE = "curves.parquet"
POLICIES_FILE = "policies.safetensors"
OF_THE_BOX = ("action.low", "action.high")  # the tensors that all seeds share

COLUMNS: Mapping[str, tuple[pa.DataType, str]] = {
    "epoch": (pa.int32(), "0, 1, …: rollouts, each followed by one update"),
    "env_steps": (pa.int64(), "steps of this seed's environment up to the end of the epoch"),
    "seed": (pa.int64(), "the seed, as the configuration names it"),
    "seconds": (pa.float64(), "wall time of the epoch, all seeds together [s]"),
    "episodes": (pa.int32(), "episodes that ended within the epoch"),
    "return_mean": (pa.float64(), "mean undiscounted return of those episodes; NaN where none ended"),
    "saturation": (pa.float64(), "fraction of executed action components within 0.1 % of a bound"),
    "action_std": (pa.float64(), "standard deviation of the executed actions, in units of half the range"),
    "kl": (pa.float64(), "mean exact KL(old‖new) of the update [nats]"),
    "approx_kl": (pa.float64(), "its estimate from the drawn latents [nats]"),
    "entropy": (pa.float64(), "mean entropy after the update, the one of the family's bonus [nats]"),
    "explained_variance": (pa.float64(), "of the returns by the values before the update"),
    "clip_fraction": (pa.float64(), "PPO: fraction of steps whose ratio ended beyond 1 ± ε"),
    "accepted": (pa.float64(), "TRPO: 1 where the line search accepted a step, else 0"),
    "step_fraction": (pa.float64(), "TRPO: accepted length, as a fraction of the full step"),
    "diverged": (pa.bool_(), "the seed's weights are not finite: leave it out of means"),
}
"""Column → type and meaning, in order; a run has those that its algorithm records."""


class Run(Protocol):
    """What is asked of an `inbounds.learning.Trainer`."""

    config: TrainConfig
    records: list[dict[str, Any]]

    @property
    def policies(self) -> list[TrainedPolicy]:
        """One per seed."""

    def tensors(self) -> dict[str, NDArray[Any]]:
        """What the policies are made of, by name."""


def save_run(run_dir: str | Path, trainer: Run) -> None:
    """Write the curves and the policies of a run as it stands.

    Args:
        run_dir: the folder; made if it does not exist.
        trainer: what `train` returned, with at least one epoch done. (`load_policy` has an example.)

    Raises:
        ValueError: no epoch is done.
    """
    if not trainer.records:
        raise ValueError("a run without an epoch has no curves: train one first")
    Path(run_dir).mkdir(parents=True, exist_ok=True)
    write_curves(Path(run_dir) / CURVES_FILE, trainer.config, trainer.records)
    save_policies(Path(run_dir) / POLICIES_FILE, trainer)


# ---- learning curves


def write_curves(path: str | Path, config: TrainConfig, records: Sequence[Mapping[str, Any]]) -> None:
    """Write records as a Parquet table, one row per epoch × seed, epoch by epoch.

    Floats are stored without loss, their bytes split into streams and compressed by zstd. The schema carries the
    meaning of each column, and the configuration under the key `inbounds`.

    Args:
        path: of the file; its folder must exist.
        config: of the run.
        records: of at least one epoch.

    Example:
        >>> import tempfile
        >>> from inbounds.learning import preset, train
        >>> run = train(preset("common", "Swimmer-v5", seeds=2, epochs=1))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_curves(f"{folder}/curves.parquet", run.config, run.records)
        ...     read_curves(folder).select(["epoch", "seed", "env_steps"]).to_pylist()
        [{'epoch': 0, 'seed': 0, 'env_steps': 2048}, {'epoch': 0, 'seed': 1, 'env_steps': 2048}]
    """
    num_seeds = len(config.seeds)
    known = [name for name in COLUMNS if name in records[0] or name == "seed"]
    fields, arrays = [], []
    for name in [*known, *sorted(records[0].keys() - COLUMNS.keys())]:
        kind, meaning = COLUMNS.get(name, (pa.float64(), ""))
        per_epoch = [config.seeds] * len(records) if name == "seed" else [record[name] for record in records]
        values = np.concatenate([np.broadcast_to(value, num_seeds) for value in per_epoch])
        fields.append(pa.field(name, kind, nullable=False, metadata={"meaning": meaning}))
        arrays.append(pa.array(values, kind, from_pandas=False))
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    write_whole(Path(path), parquet_bytes(table, metadata_of(config)))


def read_curves(run: str | Path) -> pa.Table:
    """Read learning curves; `config_of` gives the configuration that they belong to.

    Args:
        run: run directory, or the Parquet file itself.

    Returns:
        The table, with the columns of `COLUMNS` that the algorithm records. (`write_curves` has an example.)

    Raises:
        FileNotFoundError: there are none.
        DamagedFileError: the file is damaged.
    """
    return read_table(find(run, CURVES_FILE))


def config_of(curves: pa.Table) -> TrainConfig:
    """Return the configuration of the run that curves belong to.

    Args:
        curves: from `read_curves`.

    Example:
        >>> import tempfile
        >>> from inbounds.learning import preset, read_curves, save_run, train
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_run(folder, train(preset("common", "Swimmer-v5", seeds=2, epochs=1)))
        ...     config_of(read_curves(folder)).seeds
        (0, 1)

    Raises:
        ValueError: they are of no run, or another version of the package wrote them, with options that this one does
            not know.
    """
    return config_from(about_of(curves.schema))


# ---- policies


def save_policies(path: str | Path, trainer: Run, seeds: Sequence[int] | None = None) -> None:
    """Write the policies of a run to a safetensors file, under the names of `Trainer.tensors`.

    Args:
        path: of the file; its folder must exist.
        trainer: the run.
        seeds: whose policies; None is all of the run.

    Raises:
        ValueError: the run has no such seed.
    """
    config, tensors = trainer.config, trainer.tensors()
    if seeds is not None:
        if unknown := sorted(set(seeds) - set(config.seeds)):
            raise ValueError(f"the run has the seeds {list(config.seeds)}, not {unknown}")
        rows = [config.seeds.index(seed) for seed in seeds]
        config = dataclasses.replace(config, seeds=tuple(seeds))
        tensors = {n: t if n in OF_THE_BOX else t[rows] for n, t in tensors.items()}
    digests = {"sha256_config": _digest_of(describe(config)), "sha256_layout": _digest_of(_layout(tensors))}
    metadata = metadata_of(config, sha256=_digest(tensors), **digests)
    write_whole(Path(path), safetensors.numpy.save(tensors, {METADATA_KEY: metadata}))


def load_policies(run: str | Path, remedy: str = "") -> list[TrainedPolicy]:
    """Load the policies of all seeds of a run.

    Args:
        run: run directory, or the safetensors file itself.
        remedy: what to do about a damaged file; by default, to repeat the training.

    Raises:
        FileNotFoundError: there are none.
        DamagedFileError: the file is damaged.
        ValueError: another version of the package wrote it, with options that this one does not know.

    Example:
        >>> import tempfile
        >>> from inbounds.learning import preset, save_run, train
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_run(folder, train(preset("common", "Swimmer-v5", seeds=2, epochs=1)))
        ...     load_policies(folder)[1]
        <TrainedPolicy: logit-normal, ppo, Swimmer-v5, seed 1>
    """
    path = find(run, POLICIES_FILE)
    path.open("rb").close()  # safetensors says of a file that may not be read that there is none
    try:
        with safetensors.safe_open(path, "np") as file:
            metadata = parsed((file.metadata() or {}).get(METADATA_KEY))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no dictionary)
    except (safetensors.SafetensorError, OSError, ValueError) as error:
        if says_nothing_of_the_file(error):
            raise
        raise damaged(path, error, remedy) from error
    described = {"sha256_config": metadata.get("config"), "sha256_layout": _layout(tensors)}
    right = all(metadata.get(name) in (None, _digest_of(it)) for name, it in described.items())  # older: none
    if metadata.get("sha256") != _digest(tensors) or not right:
        raise damaged(path, "its checksum is wrong", remedy)
    return policies_from(config_from(metadata), tensors)


def load_policy(run: str | Path, seed_index: int = 0) -> TrainedPolicy:
    """Load the policy of one seed of a run.

    Args:
        run: run directory, or the safetensors file itself.
        seed_index: which, 0 the first of the run.

    Returns:
        The policy; `act` takes and returns NumPy arrays.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: the file is damaged.
        ValueError: another version of the package wrote it, with options that this one does not know.
        IndexError: the run has fewer seeds.

    Warns:
        RuntimeWarning: that seed diverged: its policy always executes the middle of the box.

    Example:
        >>> import tempfile
        >>> import numpy as np
        >>> from inbounds.learning import preset, save_run, train
        >>> run = train(preset("common", "Swimmer-v5", seeds=2, epochs=1))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_run(folder, run)
        ...     policy = load_policy(folder, seed_index=1)
        >>> policy.act(np.zeros(8), greedy="median").shape, policy.seed
        ((2,), 1)
    """
    policies = load_policies(run)
    if not 0 <= seed_index < len(policies):
        raise IndexError(
            f"the run has {len(policies)} seeds: choose a seed index from 0 to {len(policies) - 1}"
        )
    if (policy := policies[seed_index]).diverged:
        warnings.warn(
            f"seed {policy.seed} diverged in training: its policy always executes the middle of the box",
            RuntimeWarning,
            stacklevel=2,
        )
    return policy


def _digest_of(config: Any) -> str:
    return hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest()


def _layout(tensors: Mapping[str, NDArray[Any]]) -> dict[str, list[Any]]:
    """Return type and shape of each tensor, which its bytes do not tell."""
    return {name: [str(each.dtype), *each.shape] for name, each in tensors.items()}


def _digest(tensors: Mapping[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(name.encode() + np.ascontiguousarray(tensors[name]).tobytes())
    return digest.hexdigest()


# ---- checkpoints


def load_checkpoint(run_dir: str | Path) -> dict[str, Any]:
    """Load a run's checkpoint.

    Args:
        run_dir: the run directory.

    Raises:
        FileNotFoundError: there is none.
        DamagedFileError: it is damaged.
    """
    return checkpoint.load(find(run_dir, CHECKPOINT_FILE))
