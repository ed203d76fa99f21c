"""How the policy changes: families, networks, rollouts, REINFORCE, PPO and TRPO over seeds in lockstep."""

from inbounds.learning.advantages import gae, normalize_advantage
from inbounds.learning.config import TrainConfig, preset
from inbounds.learning.families.family import Limits, Parameters
from inbounds.learning.families.initial_noise import executed_std
from inbounds.learning.families.policy import FAMILIES, Family, Policy, PolicyConfig
from inbounds.learning.networks.actor_critic import ActorCritic, NetworkConfig
from inbounds.learning.networks.normalizer import RunningNormalizer
from inbounds.learning.networks.perceptron import Mlp, SeedLinear, mlp
from inbounds.learning.policy_gradient import PolicyGradientConfig
from inbounds.learning.ppo import PPOConfig
from inbounds.learning.rollout import Collector, Rollout
from inbounds.learning.storage.run_store import config_of, load_policies, load_policy, read_curves, save_run
from inbounds.learning.storage.trained_policy import TrainedPolicy
from inbounds.learning.training import DivergedSeedWarning, Trainer, prepare, train
from inbounds.learning.trpo import TRPOConfig

__all__ = [
    "FAMILIES",
    "ActorCritic",
    "Collector",
    "DivergedSeedWarning",
    "Family",
    "Limits",
    "Mlp",
    "NetworkConfig",
    "PPOConfig",
    "Parameters",
    "Policy",
    "PolicyConfig",
    "PolicyGradientConfig",
    "Rollout",
    "RunningNormalizer",
    "SeedLinear",
    "TRPOConfig",
    "TrainConfig",
    "TrainedPolicy",
    "Trainer",
    "config_of",
    "executed_std",
    "gae",
    "load_policies",
    "load_policy",
    "mlp",
    "normalize_advantage",
    "prepare",
    "preset",
    "read_curves",
    "save_run",
    "train",
]
