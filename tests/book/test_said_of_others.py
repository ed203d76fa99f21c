"""What the chapters say of other programs, where these are installed."""

import inspect

from stable_baselines3 import PPO


def test_defaults_of_stable_baselines3() -> None:
    """*KL invariance*: no entropy bonus by default. *Many steps from one batch*: `target_kl` stops an update early."""
    parameters = inspect.signature(PPO.__init__).parameters
    assert parameters["ent_coef"].default == 0
    assert "target_kl" in parameters
    assert "approx_kl_div > 1.5 * self.target_kl" in inspect.getsource(PPO.train)
