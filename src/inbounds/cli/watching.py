"""`inbounds watch`: a trained policy on film."""

from __future__ import annotations

import contextlib
import math
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from numpy.typing import NDArray

from inbounds import robots  # its names are imported on first use, and MuJoCo with them
from inbounds.book.drawing.videos import require_encoder, write_film
from inbounds.cli.errors import CommandError, is_ours
from inbounds.cli.modules import find_modules_here, module_of
from inbounds.cli.options import Watch, quoted
from inbounds.cli.progress import format_return
from inbounds.headless import BackendError
from inbounds.learning.storage.run_store import POLICIES_FILE, load_policies
from inbounds.learning.storage.trained_policy import TrainedPolicy
from inbounds.learning.storage.whole_files import is_disk_full
from inbounds.learning.training import make_environments


def run(command: Watch) -> int:
    """Film a rollout and print its return.

    Raises:
        CommandError: no such run or seed, nothing to draw with, no room; the message names the fix.
    """
    policy = _choose(command)
    greedy = command.greedy
    path = command.out or (
        (command.run if command.run.is_dir() else command.run.parent) / f"{greedy}-seed{policy.seed}.mp4"
    )
    _check(command, policy.config.env, path)
    file = path.absolute()  # the environment, once imported, may change the directory
    rng = np.random.default_rng(command.env_seed)

    def act(obs: NDArray[Any]) -> NDArray[Any]:
        return policy.act(obs.reshape(1, -1), greedy, rng)

    try:
        require_encoder()  # before the film is made, not after
        envs = RecordEpisodeStatistics(make_environments(policy.config, 1), buffer_length=sys.maxsize)
        with contextlib.closing(envs):
            film = robots.record(
                envs,
                act,
                seconds=command.seconds,
                seed=command.env_seed,
                width=command.width,
                height=command.height,
            )
    except BackendError:
        raise
    except (gymnasium.error.Error, ImportError) as error:
        raise CommandError(
            f"{policy.config.env} cannot be made here: {str(error).rstrip('.')}. Train it as module:id, or let the "
            "policy act in an environment of yours: load_policy(run).act(obs)"
        ) from error
    except MemoryError as error:
        fewer = "choose fewer --seconds, or a smaller --width and --height"
        raise CommandError(f"there is no memory for such a film: {fewer}") from error
    except (ValueError, TypeError, RuntimeError) as error:
        if not is_ours(error):
            raise  # the environment's own
        raise CommandError(str(error)) from error
    try:
        write_film(file, film)
    except RuntimeError as error:  # of the encoder
        raise CommandError(str(error)) from error
    except OSError as error:
        room = " Free some space on the disk and repeat the command." if is_disk_full(error) else ""
        other = room or " Choose another --out."
        raise CommandError(f"{path} could not be written: {error.strerror or error}.{other}") from error
    print(f"{policy.config.env}, {policy.config.policy.family}, seed {policy.seed}, acting by {greedy}")
    over = ", ".join(map(format_return, envs.return_queue))
    count = len(envs.return_queue)
    episodes = {0: "an episode under way", 1: f"one whole episode: {over}"}.get(
        count, f"{count} episodes: {over}"
    )
    if count and not math.isclose(film.total_reward, sum(envs.return_queue), abs_tol=1e-3):
        episodes += ", and one under way"
    print(f"return {format_return(film.total_reward)} in {len(film.frames) / film.fps:.1f} s ({episodes})")
    print(f"film: {path}")
    return 0


def _check(command: Watch, env: str, path: Path) -> None:
    """Raise unless the film can be made as it is asked for."""
    if not 0 < command.seconds < math.inf or min(command.width, command.height) < 2:
        raise CommandError("--seconds, --width and --height must be positive numbers", 2)
    if command.width % 2 or command.height % 2:
        raise CommandError("--width and --height must be even: the film's colours come in squares of four", 2)
    if command.env_seed < 0:
        raise CommandError("--env-seed must be 0 or more", 2)
    if path.is_dir():
        raise CommandError(f"{path} is a folder: name the film (--out {quoted(path / 'film.mp4')})", 2)
    if path.suffix != ".mp4":
        raise CommandError(f"a film is an MP4: --out {quoted(path.with_suffix('.mp4'))}", 2)
    if not path.parent.is_dir():
        raise CommandError(
            f"there is no folder {path.parent}: make it first (mkdir -p {quoted(path.parent)})"
        )
    if module := module_of(env):
        if not command.trust:
            raise CommandError(
                f"the run names {env} as its environment: to film it, Python imports the module {module}, and "
                "executes whatever is in it. If you know who wrote the run and the module, allow it: "
                f"inbounds watch {quoted(command.run)} --trust"
            )
        find_modules_here()


def _choose(command: Watch) -> TrainedPolicy:
    """Return the policy that the command means."""
    try:
        policies = load_policies(command.run)
    except FileNotFoundError:
        here = Path("runs") if command.run.parent == Path() else command.run.parent
        found = sorted(quoted(path.parent) for path in here.glob(f"*/{POLICIES_FILE}"))
        instead = f"choose one of {', '.join(found)}" if found else "train one first (inbounds train --help)"
        raise CommandError(f"there is no trained run in {command.run}: {instead}") from None
    except ValueError as error:  # damaged, or of another version
        raise CommandError(str(error)) from error
    except PermissionError as error:
        raise CommandError(
            f"{command.run} cannot be read ({error.strerror}): change its permissions"
        ) from error
    healthy = [str(i) for i, policy in enumerate(policies) if not policy.diverged]
    if not 0 <= command.seed_index < len(policies):
        raise CommandError(
            f"--seed-index {command.seed_index}: the run has {len(policies)} seeds, 0 to {len(policies) - 1}",
            2,
        )
    policy = policies[command.seed_index]
    if policy.diverged:
        instead = (
            f"choose another --seed-index, of {', '.join(healthy)}"
            if healthy
            else "all seeds did: train anew"
        )
        raise CommandError(f"seed {policy.seed} diverged in training: {instead}")
    return policy
