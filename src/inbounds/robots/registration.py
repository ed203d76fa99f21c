"""The six tasks under Gymnasium's own roof: `gymnasium.make_vec("inbounds/HalfCheetah-v5", num_envs=10)`.

The ids are `inbounds/` and Gymnasium's name of the task: the same task to the last bit, another engine under it.
They are known once `inbounds.robots` has been imported; or the id itself names a module to import:
`"inbounds.robots:inbounds/HalfCheetah-v5"`.
"""

from gymnasium.envs import registration

NAMESPACE = "inbounds"
TASK_NAMES = ("Hopper-v5", "Walker2d-v5", "HalfCheetah-v5", "Ant-v5", "Humanoid-v5", "Swimmer-v5")
MAX_EPISODE_STEPS = 1000


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
                vector_entry_point="inbounds.robots.vector_env:RobotVectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs={"name": name},
            )
