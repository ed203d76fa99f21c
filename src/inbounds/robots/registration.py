"""The six tasks under Gymnasium's own roof: ``gymnasium.make_vec("inbounds/HalfCheetah-v5", num_envs=10)``.

The ids are ``inbounds/`` and Gymnasium's name of the task: the same task to the last bit, another engine under it.
They are known once anything that steps robots has been imported, such as :func:`make`; or the id itself names the
module to import: ``"inbounds.robots.vector_env:inbounds/HalfCheetah-v5"``.
"""

from typing import TYPE_CHECKING, Any

from gymnasium.envs import registration

from inbounds.robots.headless import naming_the_backend

if TYPE_CHECKING:
    from inbounds.robots.vector_env import RobotVectorEnv

NAMESPACE = "inbounds"
TASK_NAMES = ("Hopper-v5", "Walker2d-v5", "HalfCheetah-v5", "Ant-v5", "Humanoid-v5", "Swimmer-v5")
MAX_EPISODE_STEPS = 1000


def make(name: str, num_envs: int = 1, **kwargs: Any) -> "RobotVectorEnv":
    """Robots with one of the six tasks, in one vector environment.

    Args:
        name: of the task, such as ``"HalfCheetah-v5"``.
        num_envs: number of robots.
        **kwargs: as for :class:`inbounds.robots.RobotVectorEnv`.

    Returns:
        The environment.

    Raises:
        ValueError: an argument is not one of those that the class names.

    Example:
        >>> envs = make("Hopper-v5", num_envs=10)
        >>> envs.reset(seed=0)[0].shape
        (10, 11)
    """
    with naming_the_backend():
        from inbounds.robots.vector_env import RobotVectorEnv

    return RobotVectorEnv(name.removeprefix(f"{NAMESPACE}/"), num_envs, **kwargs)


def register() -> None:
    """Register the tasks for :func:`gymnasium.make_vec`; repeated calls do no harm.

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
                vector_entry_point="inbounds.robots.vector_env:RobotVectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs={"name": name},
            )
