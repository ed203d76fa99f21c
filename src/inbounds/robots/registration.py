"""The six tasks under Gymnasium's own roof: `gymnasium.make_vec("inbounds/HalfCheetah-v5", num_envs=10)`.

The ids are `inbounds/` and Gymnasium's name of the task: the same task to the last bit, another engine under it.
They are known once `inbounds.robots` has been imported; or the id itself names a module to import:
`"inbounds.robots:inbounds/HalfCheetah-v5"`.
"""

from typing import Any, NoReturn

import gymnasium
from gymnasium.envs import registration

NAMESPACE = "inbounds"
TASK_NAMES = ("Hopper-v5", "Walker2d-v5", "HalfCheetah-v5", "Ant-v5", "Humanoid-v5", "Swimmer-v5")
MAX_EPISODE_STEPS = 1000


def only_many(name: str, **_: Any) -> NoReturn:
    """Say what to call where `gymnasium.make` was called: these are several robots, in one environment.

    Args:
        name: of the task.

    Raises:
        gymnasium.error.Error: always.

    Example:
        >>> gymnasium.make("inbounds/Swimmer-v5")
        Traceback (most recent call last):
        ...
        gymnasium.error.Error: inbounds/Swimmer-v5 is made by gymnasium.make_vec("inbounds/Swimmer-v5", ...)
    """
    own = f"{NAMESPACE}/{name}"
    raise gymnasium.error.Error(
        f'{own} is made by gymnasium.make_vec("{own}", num_envs=10), many robots in one environment; '
        f'one robot by itself is Gymnasium\'s: gymnasium.make("{name}")'
    )


def register() -> None:
    """Register the tasks for `gymnasium.make_vec`; repeated calls do no harm.

    Example:
        >>> import gymnasium
        >>> register()
        >>> gymnasium.make_vec("inbounds/Swimmer-v5", num_envs=3)
        RobotVectorEnv(inbounds/Swimmer-v5, num_envs=3)
    """
    for name in TASK_NAMES:
        if f"{NAMESPACE}/{name}" not in registration.registry:
            registration.register(
                f"{NAMESPACE}/{name}",
                entry_point=f"{__name__}:only_many",
                vector_entry_point="inbounds.robots.vector_env:RobotVectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs={"name": name},
            )
