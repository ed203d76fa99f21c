"""The command line, read off the configurations: their fields are its options, their docstrings its help."""

from __future__ import annotations

import argparse
import dataclasses
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from tyro import MISSING_NONPROP
from tyro.conf import AvoidSubcommands, Positional, arg
from tyro.constructors import PrimitiveConstructorSpec

from inbounds.cli.commands import read, read_one_of
from inbounds.cli.errors import CommandError
from inbounds.learning import PolicyConfig, TrainConfig, preset
from inbounds.learning.config import ALGORITHMS
from inbounds.learning.families.policy import family_of

DESCRIPTION = (
    "Policy gradients on bounded action spaces: train policies over seeds in lockstep, film them, measure. "
    "inbounds --version says which version this is."
)

# Written out, because a type must be; a test compares them with inbounds.learning's tables.
FamilyName: TypeAlias = Literal["gaussian", "clipped-gaussian", "beta", "logit-normal"]
AlgorithmName: TypeAlias = Literal["ppo", "trpo", "policy-gradient"]
PresetName: TypeAlias = Literal["common", "as-printed"]
Greedy: TypeAlias = Literal["mean", "median", "mode", "sample"]
MOST_SEEDS = 10_000
"""Of one run, which keeps all of them in memory."""


def parse_seeds(text: str) -> tuple[int, ...]:
    """Return the seeds that a word stands for.

    Args:
        text: a number says how many, a comma or a dash says which.

    Raises:
        ValueError: it is none of these.

    Example:
        >>> parse_seeds("3"), parse_seeds("3,"), parse_seeds("0,7"), parse_seeds("10-13")
        ((0, 1, 2), (3,), (0, 7), (10, 11, 12, 13))
    """
    named: tuple[int, ...] = ()
    try:
        if "," in text:
            named = tuple(int(part) for part in text.split(",") if part)
            if not named:
                raise ValueError
            first, last = 0, len(named) - 1
        elif "-" in text:
            first, last = map(int, text.split("-"))
            if first > last:
                raise ValueError
        else:
            first, last = 0, int(text) - 1
            if last < first:
                raise ValueError
    except ValueError:
        raise ValueError(
            f"{text[:80]!r} names no seeds: give a number of seeds (10), some of them (0,7) or a range (10-19)"
        ) from None
    if last - first >= MOST_SEEDS:
        raise ValueError(
            f"{text[:80]!r} asks for {last - first + 1} seeds; one run holds at most {MOST_SEEDS}"
        )
    return named or tuple(range(first, last + 1))


def format_seeds(seeds: Sequence[int]) -> str:
    """Return the shortest word that `parse_seeds` reads as these seeds.

    Example:
        >>> format_seeds((0, 1, 2)), format_seeds((3,)), format_seeds((0, 7)), format_seeds((10, 11, 12))
        ('3', '3,', '0,7', '10-12')
    """
    seeds = tuple(seeds)
    if seeds == tuple(range(len(seeds))):
        return str(len(seeds))
    if len(seeds) > 1 and seeds == tuple(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]}-{seeds[-1]}"
    return ",".join(map(str, seeds)) + ("," if len(seeds) == 1 else "")


def quoted(path: Path) -> str:
    """Return a path as a shell takes it back: what has a space is quoted.

    Example:
        >>> quoted(Path("my runs/hopper")), quoted(Path("runs/hopper"))
        ("'my runs/hopper'", 'runs/hopper')
    """
    return shlex.quote(str(path))


_SEEDS: PrimitiveConstructorSpec[tuple[int, ...]] = PrimitiveConstructorSpec(
    nargs=1,
    metavar="N|LIST|RANGE",
    instance_from_str=lambda words: parse_seeds(words[0]),
    is_instance=lambda value: isinstance(value, tuple),
    str_from_instance=lambda seeds: [format_seeds(seeds)],
)


@dataclass(frozen=True)
class PolicyOptions(PolicyConfig):
    """The family and how network outputs become its parameters."""

    family: Annotated[FamilyName, arg(name="policy", prefix_name=False)] = "logit-normal"
    """The policy family: which law the latent has, and which map makes it an action. The default is the book's subject;
    what the book advises is on its page *Which policy?*."""


@dataclass(frozen=True)
class Train(TrainConfig):
    """Train a policy, all seeds at once; go on with the run if its directory exists.

    The directory keeps curves.parquet (one row per epoch and seed), policies.safetensors (for `inbounds watch` and
    `inbounds.learning.load_policy`) and checkpoint.pt (to go on from). Ctrl-C stops after the epoch under way and keeps
    everything; a second one stops at once.
    """

    env: Annotated[Positional[str], arg(metavar="ENV")] = "HalfCheetah-v5"
    """Hopper-v5, Walker2d-v5, HalfCheetah-v5, Ant-v5, Humanoid-v5 or Swimmer-v5, or any id that `gymnasium.make` knows
    and that has a bounded, one-dimensional Box of actions. Its observations are a Box, which is flattened."""
    seeds: Annotated[tuple[int, ...], _SEEDS] = tuple(range(10))
    """Trained in lockstep; none notices the others. How many (10), or which (0,7 or 10-19)."""
    policy: PolicyOptions = field(default_factory=PolicyOptions)
    """The family and how network outputs become its parameters."""
    preset: PresetName = "common"
    """Where every other value starts from. common: what public implementations have settled on. as-printed: the
    source thesis' tables to the letter."""
    algo: AlgorithmName = "ppo"
    """PPO, TRPO, or REINFORCE with a baseline; decides which --algorithm.* values there are."""
    out: Path | None = None
    """Run directory; by default runs/ENV-POLICY-ALGO, with -as-printed after that preset."""
    tensorboard: bool = False
    """Also write TensorBoard events, one run per seed, to tensorboard/ in the run directory."""

    def train_config(self) -> TrainConfig:
        """Return the configuration itself, free of the command line."""
        return dataclasses.replace(_as(TrainConfig, self), policy=_as(PolicyConfig, self.policy))

    def run_dir(self) -> Path:
        """Return the run directory, the default one if none is named."""
        name = f"{self.env.replace('/', '-').replace(':', '-')}-{self.policy.family}-{self.algo}"
        return self.out or Path("runs") / (name + ("-as-printed" if self.preset == "as-printed" else ""))


@dataclass(frozen=True)
class Watch:
    """Film a trained policy in a robot of MuJoCo, off screen, as an MP4 file, and print its return.

    In any other environment `inbounds.learning.load_policy(run).act(obs)` acts.
    """

    run: Annotated[Positional[Path], arg(metavar="RUN")]
    """Run directory, or the file policies.safetensors of one."""
    greedy: Greedy = "median"
    """How to act."""
    seed_index: int = 0
    """Which of the run's seeds, 0 the first."""
    seconds: float = 10.0
    """Simulated time to film."""
    env_seed: int = 0
    """Seed of the environment's reset, and of what `sample` draws."""
    width: int = 480
    """Pixels; even."""
    height: int = 360
    """Pixels; even."""
    out: Path | None = None
    """The file; by default RUN/GREEDY-seedS.mp4."""
    trust: bool = False
    """Import the module that the run names for its environment (my_module:Env-v0), which executes that module's code:
    only where you know who wrote the run and the module."""


@dataclass(frozen=True)
class Bench:
    """Measure speed beside peers and beside the physics floor (benchmarks/run.py of the source tree).

    All options go to benchmarks/run.py; `inbounds bench --help` shows its own, where it is there.
    """


@dataclass(frozen=True)
class Study:
    """Run the book's two studies: algorithms, families and robots, ten seeds a cell.

    `inbounds study --help` shows its own commands and options.
    """


@dataclass(frozen=True)
class Doctor:
    """Look at this machine and say how to mend what is missing.

    Python, packages and extras, disk, OpenGL, the encoder of films, and two seconds of training.
    """


@dataclass(frozen=True)
class Grade:
    """Run a class's notebooks and tell what their graders say, by notebook and exercise.

    Each notebook runs in a process of its own, with limits to time and memory. This is no sandbox: a notebook may read
    and write whatever you may.
    """

    notebooks: Annotated[Positional[tuple[Path, ...]], arg(metavar="FILE|FOLDER ...")]
    """Notebooks, or folders of them: the student's copies of `make lab`."""
    seconds: float = 600.0
    """That a notebook may take."""
    gigabytes: float = 6.0
    """That a notebook may allocate."""
    out: Path | None = None
    """A CSV file for the table."""


Command: TypeAlias = Train | Watch | Bench | Study | Doctor | Grade
COMMANDS: dict[str, type[Command]] = {
    "train": Train,
    "watch": Watch,
    "bench": Bench,
    "study": Study,
    "doctor": Doctor,
    "grade": Grade,
}


def parse(args: Sequence[str]) -> Command:
    """Read a command line.

    Args:
        args: the words after the program's name.

    Raises:
        SystemExit: help was asked for and has been written (code 0), or what is wrong has been (code 2).
        CommandError: an option is another algorithm's.

    Example:
        >>> command = parse(["train", "Hopper-v5", "--seeds", "2", "--algo", "trpo", "--algorithm.max-kl", "0.02"])
        >>> command.env, command.seeds, command.algorithm.max_kl
        ('Hopper-v5', (0, 1), 0.02)
    """
    name, rest = (args[0], args[1:]) if args and args[0] in COMMANDS else (None, args)
    if name is None:  # help, or no command of that name
        read_one_of(COMMANDS, rest, "inbounds", DESCRIPTION)
        raise AssertionError("tyro accepts no command line without a command")
    default = _train_defaults(rest) if name == "train" else MISSING_NONPROP
    command: Command = read(
        COMMANDS[name], args=rest, prog=f"inbounds {name}", default=default, config=(AvoidSubcommands,)
    )
    return command


def _train_defaults(args: Sequence[str]) -> Train:
    """Return the values of the preset and the algorithm that the command line names."""
    look = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    look.add_argument("--preset", default="common")
    look.add_argument("--algo", default="ppo")
    look.add_argument("--policy", default="logit-normal")
    try:
        seen, _ = look.parse_known_args(args)
        config = preset(seen.preset, algo=seen.algo)
        _forbid_options_of_others(args, seen.algo)
        _forbid_limits_of_others(args, seen.policy)
    except (argparse.ArgumentError, ValueError):  # tyro will say what is wrong
        config = preset("common")
    return Train(**_values(config) | {"policy": PolicyOptions(**_values(config.policy))})


def _forbid_options_of_others(args: Sequence[str], algo: str) -> None:
    """Raise a CommandError that names the algorithm whose option this is."""
    for word in args:
        option = word.partition("=")[0]
        name = option.removeprefix("--algorithm.").replace("-", "_").removeprefix("no_")
        owners = [other for other, (kind, _) in ALGORITHMS.items() if name in kind.__dataclass_fields__]
        if option.startswith("--algorithm.") and owners and algo not in owners:
            remedy = " or ".join(f"--algo {owner}" for owner in owners)
            raise CommandError(f"{option} is no option of {algo}: add {remedy}", exit_code=2)


def _forbid_limits_of_others(args: Sequence[str], family: str) -> None:
    """Raise a CommandError for a limit that this family's law has no parameter for."""
    has_scale = "log_scale" in family_of(family).law.named.names()
    for word in args:
        option = word.partition("=")[0].replace("_", "-")
        of_scale = option in ("--policy.limits.log-std-min", "--policy.limits.log-std-max")
        if (of_scale and not has_scale) or (option == "--policy.limits.concentration-max" and has_scale):
            raise CommandError(f"{option} limits nothing of {family}: leave it out", exit_code=2)


def _values(config: Any) -> dict[str, Any]:
    return {f.name: getattr(config, f.name) for f in dataclasses.fields(config)}


def _as(kind: type[Any], config: Any) -> Any:
    """Return the part of a configuration that a base class of its own class knows."""
    return kind(**{f.name: getattr(config, f.name) for f in dataclasses.fields(kind)})
