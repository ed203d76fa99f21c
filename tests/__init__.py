"""The tests. Importing the package first chooses the off-screen renderer before any test imports mujoco."""

import inbounds  # noqa: F401
