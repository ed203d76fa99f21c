"""The book's laws in libraries that train policies themselves: one module per library, imported by name.

| Library           | Module of `inbounds.integrations` | What it gives                                                |
|-------------------|-----------------------------------|--------------------------------------------------------------|
| stable-baselines3 | `stable_baselines3`               | `LogitNormalPolicy`, `quiet_start`: PPO, A2C, TRPO;          |
|                   |                                   | `LogitNormalActor`: the trained policy, to deploy            |
|                   | `stable_baselines3_beta`          | `BetaPolicy`, which `quiet_start` takes, too                 |
| TorchRL           | `torchrl`                         | `bounded_actor`, `quiet_actor`: logit-normal, Beta           |
| either, or none   | `quiet`                           | `quiet_scale`, `quiet_concentration`: the σ of a start with  |
|                   |                                   | little noise, or a Beta's α = β                              |

Both keep the rule of the book: the library stores, and scores, the *latent*; the action is made from it on the way
into the environment. Neither library is needed by the rest of the package: `pip install ".[integrations]"`
in the source tree.
"""
