"""How the study's robots move, played once and kept: *Inside the policies* reads `results/motions.safetensors`.

Trajectories of simulated robots part between processors, and shares, paces and angles with them. So each is played
once, its numbers are kept with the sums of the policies that were played, and the page is the same on every machine.

    python -m inbounds.book.motions        plays all of it again and writes the file, about ten minutes of a core
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from inbounds import robots
from inbounds.book.report.over_seeds import final_policies
from inbounds.learning import TrainedPolicy, Trainer, preset
from inbounds.learning.storage.run_metadata import METADATA_KEY
from inbounds.learning.storage.whole_files import DamagedFileError, damaged
from inbounds.study import store
from inbounds.study.grid import AFTERWARDS, COMPARED
from inbounds.study.ledger.untrained_returns import LOUD
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.running.provenance import provenance
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import of_others

Floats = NDArray[np.float64]
LEVELS: Mapping[str, float | None] = {"quiet": 0.4, "default": None, "loud": LOUD}
"""Executed noise of untrained policies; None is each family's own."""
TERMS = ("forward", "ctrl", "survive", "contact")
"""Of a reward, in the order of `terms_of`."""
EVERY = 75
"""Of how many states one is kept, for a policy to be asked in it."""
EPISODES, STEPS = 3, 1000


def episodes(
    policies: Sequence[TrainedPolicy], number: int = EPISODES, steps: int = STEPS
) -> tuple[Floats, Floats]:
    """Play HalfCheetah with noise.

    Args:
        policies: S of them.
        number: of episodes each.
        steps: of each episode.

    Returns:
        States `[S, number, steps, O]` and rewards `[S, number, steps]`.
    """
    envs = robots.make("HalfCheetah-v5", len(policies) * number)
    obs, _ = envs.reset(seed=list(range(len(policies) * number)))
    rng, states, rewards = np.random.default_rng(0), [], []
    for _ in range(steps):
        states.append(obs.reshape(len(policies), number, -1).copy())
        action = [policy.act(each, "sample", rng) for policy, each in zip(policies, states[-1], strict=True)]
        obs, reward, *_ = envs.step(np.concatenate(action))
        rewards.append(reward.reshape(len(policies), number).copy())
    envs.close()
    return np.stack(states, 2), np.stack(rewards, 2)


def on_its_back(states: Floats) -> NDArray[np.bool_]:
    """Return whether HalfCheetah's trunk, whose pitch is the second number of a state, is upside down.

    Example:
        >>> on_its_back(np.array([[0.0, 0.1], [0.0, 3.0]])).tolist()
        [False, True]
    """
    return np.cos(states[..., 1]) < 0


def posture(states: Floats, rewards: Floats) -> dict[str, Floats]:
    """Return what postures come to, of each policy: numbers of steps and what they paid, `[S]` each.

    Example:
        >>> {name: found.tolist() for name, found in posture(np.full((1, 1, 4, 2), 3.0), np.ones((1, 1, 4))).items()}
        {'down': [4.0], 'up': [0.0], 'down_pay': [4.0], 'up_pay': [0.0]}
    """
    down = on_its_back(states)
    return {
        "down": down.sum((1, 2)).astype(float),
        "up": (~down).sum((1, 2)).astype(float),
        "down_pay": np.where(down, rewards, 0).sum((1, 2)),
        "up_pay": np.where(down, 0, rewards).sum((1, 2)),
    }


def terms_of(policy: TrainedPolicy, way: str, robot: str, steps: int = 500) -> Floats:
    """Return the terms of a robot's reward, means per step of two robots, `[4]`, in the order of `TERMS`."""
    envs = robots.make(robot, 2)
    obs, _ = envs.reset(seed=[0, 1])
    rng, total = np.random.default_rng(0), np.zeros(len(TERMS))
    for _ in range(steps):
        obs, *_, info = envs.step(policy.act(obs, way, rng))
        for part in (info, info.get("final_info", {})):  # of an episode's last step
            total += [np.sum(part.get(f"reward_{term}", 0)) for term in TERMS]
    envs.close()
    return total / (2 * steps)


def swum(policies: Sequence[TrainedPolicy], steps: int = STEPS) -> tuple[Floats, Floats]:
    """Return rewards `[T, S]` and angles `[T, S, 3]` of an episode of Swimmer by the median."""
    envs = robots.make("Swimmer-v5", len(policies))
    obs, _ = envs.reset(seed=list(range(len(policies))))
    rewards, angles = [], []
    for _ in range(steps):
        angles.append(obs[:, :3].copy())  # of the head and of two joints
        action = np.stack([policy.act(each, "median") for policy, each in zip(policies, obs, strict=True)])
        obs, reward, *_ = envs.step(action)
        rewards.append(reward.copy())
    envs.close()
    return np.array(rewards), np.array(angles)


def paid_ahead(angles: Floats) -> Floats:
    """Return how far Swimmer's point that is paid lies ahead of its centre of mass, in metres.

    Args:
        angles: of the head and of the two joints, `[..., 3]`.

    Example:
        >>> paid_ahead(np.zeros(3)).item()  # stretched: nowhere
        0.0
    """
    head, middle, tail = np.moveaxis(np.cos(np.cumsum(angles, -1)), -1, 0)
    return (1.5 * middle + 0.5 * tail - 2 * head) / 3


def stroke(rewards: Floats, angles: Floats) -> dict[str, Floats]:
    """Return six numbers of each seed's episode, `[S]` each; the angles once it swims, after twelve seconds."""
    later = angles[300:]
    ahead, in_the_end = paid_ahead(angles), paid_ahead(later).mean(axis=0)
    return {
        "total": rewards.sum(axis=0),
        "fold": np.degrees(np.abs(later[..., 1].mean(axis=0))),
        "swing": np.degrees(later[..., 1].std(axis=0)),
        "for folding": in_the_end / 0.04,  # points
        "paid after": 0.04 * (ahead > 0.9 * in_the_end).argmax(axis=0),
        "discounted": 0.99 ** np.arange(len(rewards)) @ rewards,
    }


def without_jumps(policy: TrainedPolicy, number: int = 10, steps: int = STEPS) -> float:
    """Return HalfCheetah's mean return by the mode, replaced by the median where it is at full torque."""
    envs = robots.make("HalfCheetah-v5", number)
    obs, _ = envs.reset(seed=list(range(number)))
    total = 0.0
    for _ in range(steps):
        mode, median = (policy.act(obs, way) for way in ("mode", "median"))
        obs, reward, *_ = envs.step(np.where(np.abs(mode) > 0.99, median, mode))
        total += float(reward.mean())
    envs.close()
    return total


def untrained_policies(family: str, std: float | None) -> list[TrainedPolicy]:
    """Return ten policies of HalfCheetah before their first update, with an executed noise; None is their own."""
    config = preset("common", "HalfCheetah-v5", policy=family, epochs=1)
    return list(Trainer(replace(config, policy=replace(config.policy, initial_std=std))).policies)


def played(outcomes: Outcomes) -> list[Outcome]:
    """Return the cells whose policies are played: all of HalfCheetah and Swimmer, PPO's of Ant and Humanoid."""
    return [
        outcome
        for name, outcome in outcomes.and_of(AFTERWARDS).finished.items()
        if outcomes.folder.policy_files(outcome.cell)[0].is_file()
        and (
            outcome.cell.robot in ("HalfCheetah", "Swimmer")
            or name.startswith(("standard-ant-ppo", "standard-humanoid-ppo"))
        )
    ]


def of_cell(outcomes: Outcomes, outcome: Outcome) -> Iterator[tuple[str, Floats]]:
    """Yield what is kept of a cell's motion, by name."""
    name, policies = outcome.cell.id, final_policies(outcomes, outcome)
    if outcome.cell.robot == "HalfCheetah":
        states, rewards = episodes(policies)
        yield from ((f"{name}/{key}", found) for key, found in posture(states, rewards).items())
        if name == "standard-halfcheetah-ppo-logit-normal":
            yield f"{name}/asked", states[:, :, ::EVERY]
        if name == "standard-halfcheetah-ppo-beta":
            yield f"{name}/without jumps", np.array([without_jumps(policy) for policy in policies])
    elif outcome.cell.robot == "Swimmer":
        yield from ((f"{name}/{key}", found) for key, found in stroke(*swum(policies)).items())
    else:
        for way in ("sample", "median"):
            terms = [terms_of(policy, way, f"{outcome.cell.robot}-v5") for policy in policies]
            yield f"{name}/{way}", np.array(terms)


def of_untrained() -> Iterator[tuple[str, Floats]]:
    """Yield what is kept of untrained policies, by name."""
    for family in ("gaussian", "logit-normal"):
        for level, std in LEVELS.items():
            found = posture(*episodes(untrained_policies(family, std)))
            yield from ((f"untrained-{family}-{level}/{key}", values) for key, values in found.items())


def of_updates() -> Iterator[tuple[str, Floats]]:
    """Yield how far PPO's first update moves HalfCheetah's networks and laws, by family, `[S]` each.

    `move` is the root mean square over the first 512 states of what the outputs move by, `length` the mean KL
    divergence of old from new law there, in nats.
    """
    for family in COMPARED:
        trainer = Trainer(preset("common", "HalfCheetah-v5", policy=family, epochs=1))
        networks, policy = trainer.networks, trainer.networks.policy
        states = trainer.collector.collect(512).obs
        before = networks.outputs(states).detach()
        trainer.epoch()
        after = networks.outputs(states).detach()
        kl = policy.law.kl(policy.parameters(before), policy.parameters(after))
        squares = (after - before).square().mean((1, 2))
        yield f"first-update-{family}/move", squares.sqrt().numpy().astype(np.float64)
        yield f"first-update-{family}/length", kl.mean(1).numpy().astype(np.float64)


def publish(folder: StudyFolder) -> Path:
    """Play everything and write the file, its checksum first.

    Returns:
        Where it is.
    """
    outcomes = Outcomes.read(folder)
    found, policies = dict([*of_untrained(), *of_updates()]), {}
    for outcome in played(outcomes):
        found |= of_cell(outcomes, outcome)
        policies[outcome.cell.id] = store.sha256(folder.policy_files(outcome.cell)[0])
        print(outcome.cell.id, flush=True)
    about = {"policies": policies, "command": "python -m inbounds.book.motions", "session": provenance()}
    kept = {name: np.ascontiguousarray(values, np.float64) for name, values in sorted(found.items())}
    path = motions_file(folder)
    folder.publish({path: safetensors.numpy.save(kept, {METADATA_KEY: json.dumps(about)})})
    return path


def motions_file(folder: StudyFolder) -> Path:
    """Return the path of the file."""
    return folder.results / store.MOTIONS


def read(folder: StudyFolder) -> dict[str, Floats]:
    """Read what is kept, by cell and quantity.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is not the one whose checksum is listed, or is of other policies than those that are there.

    Example:
        >>> read(StudyFolder())["standard-swimmer-ppo-beta/fold"].shape  # in the project's folder
        (10,)
    """
    path = motions_file(folder)
    if not path.is_file():
        raise FileNotFoundError(f"there is no {path}: {store.make(path)}")
    if store.sha256(path) != folder.checksums().get(path.name):
        raise damaged(path, f"it is not what {store.CHECKSUMS_FILE} lists", store.restore(path))
    for name, sum_of_played in about(folder)["policies"].items():
        if said := of_others(path, folder.results / "policies" / f"{name}.safetensors", sum_of_played):
            raise DamagedFileError(said)
    return dict(safetensors.numpy.load_file(path))


def about(folder: StudyFolder) -> dict[str, Any]:
    """Return what the file says of itself: the sums of the policies that were played, the command, the machine."""
    with safetensors.safe_open(motions_file(folder), framework="np") as file:
        return dict(json.loads(file.metadata()[METADATA_KEY]))


if __name__ == "__main__":
    print(publish(StudyFolder.shipped()))
