"""Robots and trained policies as JavaScript: one small script each, which a page loads when it is asked for.

A policy's numbers are those of `results/policies`, float32 and unrounded; the observations' statistics are float64.
A script holds JSON; the numbers stand in it as base64 of a gzip stream.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import safetensors.numpy
from numpy.typing import NDArray

from inbounds.book.templates import script_json
from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.seeding import SeedStreams
from inbounds.learning.updates.threads import one_thread
from inbounds.robots.messages import install_handler
from inbounds.robots.tasks import ASSETS, Task
from inbounds.robots.vector_env import TASKS
from inbounds.study.grid import ARMS, ROBOTS, Cell
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import ways_of

install_handler()

NAMES = {"gaussian": "Gaussian, clipped", "beta": "Beta", "logit-normal": "logit-normal"}
_TASK = (
    "frame_skip", "hidden", "forward_weight", "control_weight", "healthy_reward", "velocity_limit", "reset_noise",
    "reset_velocity_is_normal", "feels_contacts", "contact_weight", "contact_limit",
)  # fmt: skip


def script(place: str, key: str, value: Any) -> str:
    r"""Return a script that puts a value where the page looks for it.

    Example:
        >>> script("robots", "Hopper", {"motors": 3})
        'inbounds.live.robots["Hopper"] = {"motors":3};\n'
    """
    return f"inbounds.live.{place}[{json.dumps(key)}] = {script_json(value)};\n"


def packed(*arrays: NDArray[Any]) -> str:
    """Return the bytes of arrays, one after the other, as base64 of a gzip stream.

    Example:
        >>> len(gzip.decompress(base64.b64decode(packed(np.zeros(3, np.float32), np.zeros(2)))))
        28
    """
    data = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")


def policy_id(cell: Cell) -> str:
    """Return how the page names a column of the study: algorithm and family."""
    return f"{cell.algorithm}-{cell.family}"


def exported_cells() -> tuple[Cell, ...]:
    """Return the cells whose policies the page can load: those of arm 1, standard practice.

    Example:
        >>> len(exported_cells())
        30
    """
    return ARMS["standard"]


def robot(name: str) -> dict[str, Any]:
    """Return what the page needs to know of a robot.

    Args:
        name: as in `inbounds.study.grid.ROBOTS`.

    Example:
        >>> robot("Swimmer")["motors"]
        ['motor1 rot', 'motor2 rot']
    """
    task: type[Task] = TASKS[f"{name}-v5"]
    model = task.load_model()
    joints = [model.joint(int(joint)).name for joint in model.actuator_trnid[:, 0]]
    return {
        "name": task.name,
        "xml": (ASSETS / task.xml_file).read_text(encoding="utf8"),
        "motors": [joint.removesuffix("_joint").replace("_", " ") for joint in joints],
        "task": {key: getattr(task, key) for key in _TASK if getattr(task, key, None) is not None},
    }


def policies(cell: Cell, folder: StudyFolder) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the trained policies of a cell, under the name of their file.

    Args:
        cell: which keeps its policies.
        folder: of the study.

    Example:
        >>> from inbounds.study.grid import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> name, stored = next(policies(cell, StudyFolder.shipped()))
        >>> name, stored["sizes"]
        ('hopper-ppo-beta-0', [11, 64, 64, 6])
    """
    path = folder.policy_files(cell)[0]
    trained = folder.load_policies(cell)  # looks at the checksum, too
    tensors = safetensors.numpy.load_file(path)
    depth = len(cell.config.network.hidden_sizes) + 1
    for i, policy in enumerate(trained):
        layers = [tensors[f"policy.{n}.{part}"][i] for n in range(depth) for part in ("weight", "bias")]
        statistics = tensors["normalizer.mean"][i], tensors["normalizer.variance"][i]
        limits = policy.config.policy.limits
        yield (
            f"{cell.robot.lower()}-{policy_id(cell)}-{policy.seed}",
            {
                "family": cell.family,
                "sizes": [layers[0].shape[1], *(bias.size for bias in layers[1::2])],
                "low": policy.low.tolist(),
                "high": policy.high.tolist(),
                "limits": {
                    "log_std_min": limits.log_std_min,
                    "log_std_max": limits.log_std_max,
                    "concentration_max": limits.concentration_max,
                },
                "numbers": packed(
                    *(layer.astype(np.float32) for layer in layers),
                    *(each.astype(np.float64) for each in statistics),
                ),
            },
        )


def starts(cell: Cell, study: StudyFolder | None = None) -> Iterator[tuple[str, str]]:
    """Yield the networks with which a cell's training began, under the name of their file.

    A seed draws the same first weights for every algorithm and family of a robot, so they are stored once.

    Args:
        cell: of the robot.
        study: the folder of its policies; None is the one that the project ships.

    Example:
        >>> from inbounds.study.grid import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> [name for name, _ in starts(cell)][:2]
        ['hopper-0', 'hopper-1']
    """
    config = cell.config
    model: mujoco.MjModel = TASKS[config.env].load_model()
    low, high = model.actuator_ctrlrange.astype(np.float32).T
    streams = [SeedStreams.of(seed).initialization for seed in config.seeds]
    with one_thread():  # as a run does: the last bit of an orthogonal matrix depends on it
        policy, obs_dim = Policy(config.policy, low, high), _obs_dim(cell, study or StudyFolder.shipped())
        nets = ActorCritic(policy, obs_dim, config.network, streams)
    for i, seed in enumerate(config.seeds):
        yield f"{cell.robot.lower()}-{seed}", packed(nets.actor.theta[i].numpy())


def _obs_dim(cell: Cell, study: StudyFolder) -> int:
    tensors = safetensors.numpy.load_file(study.policy_files(cell)[0])
    return int(tensors["normalizer.mean"].shape[1])


def catalogue() -> str:
    """Return the script that says what there is to choose from."""
    cells = exported_cells()
    names = {policy_id(cell): f"{cell.algorithm.upper()}, {NAMES[cell.family]}" for cell in cells}
    known = {
        "robots": {name: name for name in ROBOTS},
        "policies": names,
        "seeds": list(cells[0].config.seeds),
        "ways": {
            family: ["sample", *(way for way in ways_of(family) if way != "sample")] for family in NAMES
        },
    }
    return f"inbounds.live.catalogue = {json.dumps(known, ensure_ascii=False)};\n"


def write(target: Path, folder: StudyFolder | None = None) -> int:
    """Write all robots and policies below a folder.

    Args:
        target: the folder; made where it is missing.
        folder: of the study; None is the one that the project ships.

    Returns:
        The characters of all policies and of the networks that they began as.
    """
    folder = folder or StudyFolder.shipped()
    for part in ("robots", "policies", "starts"):
        (target / part).mkdir(parents=True, exist_ok=True)
    (target / "catalogue.js").write_text(catalogue(), encoding="utf8")
    for name in ROBOTS:
        (target / "robots" / f"{name}.js").write_text(script("robots", name, robot(name)), encoding="utf8")
    total = 0
    seen: set[str] = set()
    for cell in exported_cells():
        for key, stored in policies(cell, folder):
            total += (target / "policies" / f"{key}.js").write_text(
                script("policies", key, stored), encoding="utf8"
            )
        if cell.robot not in seen:
            seen.add(cell.robot)
            for key, text in starts(cell, folder):
                total += (target / "starts" / f"{key}.js").write_text(
                    script("starts", key, text), encoding="utf8"
                )
    return total
