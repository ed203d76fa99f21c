"""What REINFORCE, PPO and TRPO share: minibatches, the regression of the values, diagnostics, checks of numbers."""
