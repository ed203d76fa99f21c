import inbounds  # noqa: F401  chooses the off-screen backend before a test imports mujoco
