"""Who takes part: each a function that gets ready and returns `turn`, which trains for one epoch.

A turn returns the env steps it took. What a study run has on is on: observation normalisation, episode statistics,
the peers' own logging, and for us a checkpoint at *every* turn (a study run writes one in ten).

Everything is imported where it is used: a contestant may live in an environment that lacks the others' packages.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import importlib.util
import os
import runpy
import sys
import tempfile
import threading
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.work import Work

Turn = Callable[[], int]


@dataclass(frozen=True)
class Contestant:
    """One row of the table."""

    label: str
    """In tables and plots."""
    start: Callable[[Work], Turn]
    """Gets ready; what it returns trains for one epoch."""
    needs: str
    """The module without which it cannot take part."""
    algorithm: str
    """PPO or TRPO."""
    seeds: int = 1
    """Seeds trained at once, each with its own environment."""


def inbounds_config(work: Work, algo: str, seeds: int, family: str) -> Any:
    """Return the preset `common` with the numbers of the work."""
    from inbounds.learning import preset

    config = preset("common", work.env, policy=family, algo=algo, seeds=seeds, epochs=10**6)
    names = {field.name for field in dataclasses.fields(config.algorithm)}
    numbers = {name: value for name, value in dataclasses.asdict(work).items() if name in names}
    return dataclasses.replace(
        config,
        algorithm=dataclasses.replace(config.algorithm, **numbers),
        network=dataclasses.replace(config.network, hidden_sizes=work.hidden),
    )


def inbounds(
    algo: str, seeds: int, family: str = "gaussian", engine: str = "autograd"
) -> Callable[[Work], Turn]:
    """Return what starts this package, by either engine."""

    def start(work: Work) -> Turn:
        from inbounds.learning import Trainer
        from inbounds.learning.storage import checkpoint

        config = inbounds_config(work, algo, seeds, family)
        trainer = Trainer(dataclasses.replace(config, engine=engine))
        path = Path(tempfile.mkdtemp()) / checkpoint.FILE_NAME

        def turn() -> int:
            trainer.epoch()
            checkpoint.save(path, trainer.state_dict())
            return seeds * work.horizon

        return turn

    return start


def stable_baselines(module: str, algo: str, normalize: bool = True) -> Callable[[Work], Turn]:
    """Return what starts an on-policy algorithm with stable-baselines3's `learn`, one rollout and update at a time."""

    def start(work: Work) -> Turn:
        from stable_baselines3.common.env_util import make_vec_env
        from stable_baselines3.common.vec_env import VecNormalize

        kind = getattr(importlib.import_module(module), algo)
        envs: Any = make_vec_env(work.env, n_envs=1, seed=0)  # with a Monitor
        if normalize:
            envs = VecNormalize(envs, norm_reward=False)
        numbers = {
            "n_steps": work.horizon,
            "batch_size": work.minibatch_size,
            "learning_rate": work.learning_rate,
        }
        numbers |= {"gamma": work.gamma, "gae_lambda": work.gae_lambda}
        if algo == "PPO":
            numbers |= {"n_epochs": work.num_epochs, "max_grad_norm": work.max_grad_norm, "ent_coef": 1e-4}
        else:
            numbers |= {"n_critic_updates": work.num_epochs, "cg_max_steps": work.cg_iters}
            # Its KL is the mean over action dimensions, too (tests/peers/test_trpo_step.py).
            numbers |= {"target_kl": work.max_kl / envs.action_space.shape[0]}
        hidden = list(work.hidden)
        model = kind(
            "MlpPolicy",
            envs,
            policy_kwargs={"net_arch": {"pi": hidden, "vf": hidden}},
            device="cpu",
            **numbers,
        )

        def turn() -> int:
            model.learn(work.horizon, reset_num_timesteps=False)
            return work.horizon

        return turn

    return start


def cleanrl(work: Work) -> Turn:
    """Start CleanRL's `ppo_continuous_action.py` (version 1.2.0) as its wheel has it, in a thread that waits its turn.

    The script has no function to call: it runs to its end. Its last line of each iteration logs `charts/SPS`, and its
    SummaryWriter, of which ours is a stub, is where it waits. It was written for Gymnasium 0.29, in which
    `TransformObservation` did not ask for the new observation space.
    """
    import gymnasium

    transform = gymnasium.wrappers.TransformObservation
    gymnasium.wrappers.TransformObservation = lambda env, f: transform(env, f, env.observation_space)  # type: ignore

    go, done = threading.Semaphore(0), threading.Semaphore(0)

    class SummaryWriter:
        def __init__(self, *args: Any) -> None:
            go.acquire()

        def add_text(self, *args: Any) -> None: ...

        def add_scalar(self, tag: str, *args: Any) -> None:
            if tag == "charts/SPS":
                done.release()
                go.acquire()

    sys.modules["torch.utils.tensorboard"] = types.SimpleNamespace(SummaryWriter=SummaryWriter)  # type: ignore
    spec = importlib.util.find_spec("cleanrl")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    script = Path(spec.submodule_search_locations[0]) / "ppo_continuous_action.py"
    options = {
        "env-id": work.env,
        "cuda": False,
        "total-timesteps": 10**9,
        "num-steps": work.horizon,
        "num-minibatches": work.horizon // work.minibatch_size,
        "update-epochs": work.num_epochs,
    }
    sys.argv = [str(script), *(f"--{name}={value}" for name, value in options.items())]

    def run() -> None:
        try:
            runpy.run_path(str(script), run_name="__main__")
        except BaseException:
            import traceback

            traceback.print_exc()
            os._exit(1)  # or the main thread waits for ever

    threading.Thread(target=run, daemon=True).start()

    def turn() -> int:
        go.release()
        done.acquire()
        return work.horizon

    return turn


def rltools(work: Work) -> Turn:
    """RLtools' PPO (Eschmann et al.), C++ that its own interface compiles for these shapes, with Gymnasium's robot.

    Its interface trains one seed. Its observations are normalised, in C++; it evaluates nothing, and writes nothing.
    Without MKL it multiplies by loops of its own, and is several times as slow: it does not take part then.
    """
    import gymnasium
    from rltools import PPO

    for package in ("mkl", "mkl-include"):
        importlib.metadata.version(package)  # raises an ImportError where it is missing

    hidden, depth = work.hidden[0], len(work.hidden) + 1
    shape: dict[str, Any] = {}
    for network in ("ACTOR", "CRITIC"):
        shape |= {f"{network}_HIDDEN_DIM": hidden, f"{network}_NUM_LAYERS": depth}
        shape[f"{network}_ACTIVATION_FUNCTION"] = "TANH"

    def make() -> Any:  # it asks for actions in [−1, 1], which those of Humanoid are not
        env: Any = gymnasium.make(work.env)
        as_asked = (env.action_space.low == -1).all() and (env.action_space.high == 1).all()
        return env if as_asked else gymnasium.wrappers.RescaleAction(env, -1.0, 1.0)

    loop = PPO(
        make,
        interface_name=f"{work.env.replace('-', '_').lower()}_{work.horizon}",
        enable_evaluation=False,
        STEP_LIMIT=10**6,
        GAMMA=work.gamma,
        LAMBDA=work.gae_lambda,
        INITIAL_ACTION_STD=1.0,
        ACTION_ENTROPY_COEFFICIENT=1e-4,
        NORMALIZE_OBSERVATIONS=True,
        N_EPOCHS=work.num_epochs,
        N_ENVIRONMENTS=1,
        ON_POLICY_RUNNER_STEPS_PER_ENV=work.horizon,
        BATCH_SIZE=work.minibatch_size,
        OPTIMIZER_ALPHA=work.learning_rate,
        **shape,
    )
    state = loop.State(0)

    def turn() -> int:
        state.step()
        return work.horizon

    return turn


CONTESTANTS: dict[str, Contestant] = {
    "inbounds-ppo-10": Contestant("In Bounds PPO, S = 10", inbounds("ppo", 10), "inbounds", "PPO", 10),
    "inbounds-ppo-1": Contestant("In Bounds PPO, S = 1", inbounds("ppo", 1), "inbounds", "PPO"),
    "inbounds-logit-normal-10": Contestant(
        "… logit-normal, S = 10", inbounds("ppo", 10, "logit-normal"), "inbounds", "PPO", 10
    ),
    "inbounds-compiled-10": Contestant(
        "In Bounds PPO, compiled, S = 10", inbounds("ppo", 10, engine="compiled"), "numba", "PPO", 10
    ),
    "inbounds-compiled-1": Contestant(
        "In Bounds PPO, compiled, S = 1", inbounds("ppo", 1, engine="compiled"), "numba", "PPO"
    ),
    "inbounds-compiled-logit-normal-10": Contestant(
        "… compiled, logit-normal, S = 10",
        inbounds("ppo", 10, "logit-normal", "compiled"),
        "numba",
        "PPO",
        10,
    ),
    "rltools-ppo": Contestant("RLtools PPO (C++)", rltools, "rltools", "PPO"),
    "sb3-ppo": Contestant(
        "stable-baselines3 PPO", stable_baselines("stable_baselines3", "PPO"), "stable_baselines3", "PPO"
    ),
    "sb3-ppo-plain": Contestant(
        "… observations as they are",
        stable_baselines("stable_baselines3", "PPO", normalize=False),
        "stable_baselines3",
        "PPO",
    ),
    "sbx-ppo": Contestant("SBX PPO", stable_baselines("sbx", "PPO"), "sbx", "PPO"),
    "cleanrl-ppo": Contestant("CleanRL PPO", cleanrl, "cleanrl", "PPO"),
    "inbounds-trpo-10": Contestant("In Bounds TRPO, S = 10", inbounds("trpo", 10), "inbounds", "TRPO", 10),
    "inbounds-trpo-1": Contestant("In Bounds TRPO, S = 1", inbounds("trpo", 1), "inbounds", "TRPO"),
    "sb3-trpo": Contestant(
        "sb3-contrib TRPO", stable_baselines("sb3_contrib", "TRPO"), "sb3_contrib", "TRPO"
    ),
}
"""By name, in the order of the table."""
