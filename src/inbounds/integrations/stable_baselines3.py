r"""The logit-normal as a policy of stable-baselines3: PPO, A2C, and sb3-contrib's TRPO take the class itself.

    model = PPO(LogitNormalPolicy, env)

The peer's own Gaussian draws an action in the *box's units*; its buffer keeps what was drawn, and the environment gets
it clipped. Here what is drawn, kept and scored is the latent z ~ N(μ, σ²), and the peer's hook for squashed policies
(`unscale_action`) makes the action low + (high − low) · sigmoid(z) of it on the way into the environment. So a
saturated action is scored exactly, its density cancels in every ratio, and an asymmetric box needs no wrapper.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from inbounds.distributions import ClippedNormal, LogitNormal
from inbounds.distributions.bounds import require_bounds
from inbounds.distributions.boxes import require_box
from inbounds.distributions.open_interval import from_line, open_ends, to_line
from inbounds.integrations.quiet import quiet_scale

try:
    from stable_baselines3.common.distributions import DiagGaussianDistribution
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.preprocessing import is_image_space
    from stable_baselines3.common.torch_layers import CombinedExtractor, NatureCNN
except ImportError as error:
    raise ImportError(
        'stable-baselines3 is not installed: pip install ".[integrations]" in the source tree'
    ) from error

__all__ = ["LogitNormalActor", "LogitNormalDistribution", "LogitNormalPolicy", "quiet_start"]


class ScoresLatents:
    """What a law of the package does in the peer's interface, where "actions" are latents `[B, A]`."""

    distribution: Any
    """`LogitNormal` or `ScaledBeta`, batch shape `[B, A]`."""

    def __init__(self, low: NDArray[Any], high: NDArray[Any]) -> None:
        super().__init__(len(low))  # type: ignore[call-arg]  # of the peer's law, the next base
        self.low, self.high = require_bounds(low, high)

    def log_prob(self, actions: Tensor) -> Tensor:
        """Return the log-density `[B]` of the *actions* that latents `[B, A]` stand for, in nats."""
        return self.distribution.log_prob_latent(actions).sum(-1)

    def entropy(self) -> Tensor:
        """Return the differential entropy `[B]` of the action in its box, in nats."""
        return self.distribution.entropy().sum(-1)

    def sample(self) -> Tensor:
        """Return reparametrised latents `[B, A]`."""
        return self.distribution.rsample_latent()

    def action(self, latent: Tensor) -> Tensor:
        """Return the actions `[B, A]` that latents stand for, strictly inside the box."""
        return self.distribution.latent_to_value(latent)


class LogitNormalDistribution(ScoresLatents, DiagGaussianDistribution):
    """A box of independent logit-normals, in the peer's interface: its "actions" are latents `[B, A]`.

    It inherits the peer's head: a layer for loc, and one free log σ per dimension.

    Args:
        low: `[A]` lower bounds of the action, in its own units.
        high: `[A]` upper bounds.

    Raises:
        ValueError: some bounds are not finite, not in order, or so close that no number is between them.

    Example:
        >>> import numpy as np
        >>> import torch
        >>> law = LogitNormalDistribution(np.array([0.0, -2.0]), np.array([8.0, 1.0]))
        >>> _ = law.proba_distribution(torch.zeros(1, 2), torch.zeros(2))
        >>> law.action(law.mode()).tolist()  # the middle of the box, with any σ
        [[4.0, -0.5]]
        >>> round(law.log_prob(torch.zeros(1, 2)).item(), 3)  # of the action, from its latent
        -2.243
    """

    distribution: LogitNormal  # type: ignore[assignment]  # the peer's is a Normal

    def proba_distribution(self, mean_actions: Tensor, log_std: Tensor) -> LogitNormalDistribution:
        """Set μ `[B, A]` and log σ `[A]` of the latent, as the peer's heads give them.

        Raises:
            ValueError: they are not finite, or σ is not.
        """
        require_finite(mean_actions, log_std)
        scale = log_std.exp()
        if not bool((torch.isfinite(scale) & (scale > 0)).all()):
            raise ValueError(
                f"log σ = {log_std.tolist()} has no positive, finite σ: set log_std_init closer to 0"
            )
        low, high = (bound.to(mean_actions) for bound in (self.low, self.high))
        self.distribution = LogitNormal(mean_actions, scale, low, high, validate_args=False)
        return self

    def mode(self) -> Tensor:
        """Return the latents `[B, A]` of the medians: what the peer calls deterministic, and a bijection keeps."""
        return self.distribution.loc

    @staticmethod
    def start_quietly(policy: Any, std: float) -> None:
        """Set σ and the head's bias; see `quiet_start`."""
        policy.log_std.fill_(math.log(quiet_scale(LogitNormal, std)))
        policy.action_net.bias.zero_()


def require_finite(*outputs: Tensor) -> None:
    """Refuse what a network gives, if it is not finite.

    Raises:
        ValueError: some number is NaN or infinite.

    Example:
        >>> require_finite(torch.zeros(2))
    """
    if not all(bool(torch.isfinite(each).all()) for each in outputs):
        raise ValueError(
            "the policy network gives NaN or ∞: look for an observation or a reward that is not finite, "
            "or take a smaller learning rate"
        )


class BoundedPolicy(ActorCriticPolicy):
    """What the policies share whose latents the peer keeps: networks, the way into the box, and what is refused."""

    law: ClassVar[type[Any]]
    """Makes a law, in the peer's interface, of two bounds `[A]`."""

    def __init__(
        self,
        observation_space: gymnasium.spaces.Space[Any],
        action_space: gymnasium.spaces.Space[Any],
        lr_schedule: Callable[[float], float],
        **options: Any,
    ) -> None:
        require_box(action_space)
        if options.get("use_sde") or options.get("squash_output"):
            raise ValueError(
                f"{type(self).__name__} draws its own noise and maps it into the box: leave use_sde=False and "
                "squash_output=False"
            )
        if isinstance(observation_space, gymnasium.spaces.Dict):  # as the peer's `MultiInputPolicy`
            options.setdefault("features_extractor_class", CombinedExtractor)
        elif is_image_space(  # as the peer's `CnnPolicy`
            observation_space, normalized_image=not options.get("normalize_images", True)
        ):
            options.setdefault("features_extractor_class", NatureCNN)
        super().__init__(observation_space, action_space, lr_schedule, **options)
        self._squash_output = True  # the peer then calls `unscale_action`, and clips nothing

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        """Put our law in the place of the peer's choice before it builds the heads."""
        self.action_dist = self.law(*self._bounds)
        super()._build(lr_schedule)

    def __getattr__(self, name: str) -> Any:
        if name in ("actor", "lstm_actor"):  # the algorithm is off policy, or recurrent
            raise AttributeError(
                f"{type(self).__name__} is for A2C, PPO and TRPO. SAC has a squashed Gaussian of its own, TD3 and DDPG "
                'an actor without a law ("MlpPolicy" there), and RecurrentPPO a memory that this policy has not'
            )
        return super().__getattr__(name)

    def unscale_action(self, scaled_action: NDArray[Any]) -> NDArray[Any]:
        """Return the actions that latents stand for, `[..., A]`, on the way into the environment."""
        latent = _floating(scaled_action)
        low, high = self._bounds  # of a narrower type than the latent's, they could be reached by rounding
        value = from_line(latent, *self._limits(latent)).numpy().astype(low.dtype)
        return np.clip(value, np.nextafter(low, high), np.nextafter(high, low))

    def scale_action(self, action: NDArray[Any]) -> NDArray[Any]:
        """Return the latents `[..., A]` that actions strictly inside the box stand for: `unscale_action`, backwards."""
        value = _floating(action)
        return to_line(value, *self._limits(value)).numpy()

    def _limits(self, like: Tensor) -> tuple[Tensor, Tensor]:
        """Return the bounds `[A]` as tensors of the type and on the device of another."""
        low, high = (torch.as_tensor(np.array(bound)).to(like) for bound in self._bounds)
        return low, high

    @property
    def _bounds(self) -> tuple[NDArray[Any], NDArray[Any]]:
        box: Any = self.action_space
        return box.low, box.high


class LogitNormalPolicy(BoundedPolicy):
    """The peer's actor-critic with logit-normal actions in any bounded box; see the module.

    Args:
        observation_space: as the peer's; a Dict or images, too, which get the networks of `MultiInputPolicy` and
            `CnnPolicy`.
        action_space: a bounded, one-dimensional Box.
        lr_schedule: as the peer's.
        **options: as the peer's; `log_std_init` is the log σ of the *latent*: 0 executes a standard deviation of
            0.42 of half the range. Generalised state-dependent exploration (`use_sde`) is not for it.

    Raises:
        ValueError: another action space (the message names the wrapper that makes this one of it), or `use_sde`.

    `predict(obs, deterministic=True)` acts by the median. Called as a module, the policy returns *latents*: to deploy
    it without the peer, export `LogitNormalActor` of it. Pass the class to the peer, not its name. The entropy, which
    the peer asks for in every minibatch, is an integral: training takes longer than `MlpPolicy`'s.

    Example:
        >>> import gymnasium
        >>> import numpy as np
        >>> from stable_baselines3 import PPO
        >>> model = PPO(LogitNormalPolicy, "Pendulum-v1", n_steps=64, device="cpu", seed=0).learn(64)
        >>> action, _ = model.predict(np.zeros((1000, 3), np.float32))
        >>> bool((abs(action) < 2).all())  # N·m: never on a bound
        True
    """

    law = LogitNormalDistribution


class LogitNormalActor(nn.Module):
    """What a `LogitNormalPolicy` does on a robot: observations `[B, O]` to the medians `[B, A]` of its actions.

    A module for `torch.export` and `torch.onnx.export`, without the peer, its critic and its noise; called itself, the
    policy returns latents.

    Args:
        policy: a trained one. Its layers are shared, not copied.

    The observations are what the policy's network sees: of its type (float32, where nothing else was asked for),
    pictures channels first and divided by 255, and where the peer normalised them (`VecNormalize`), normalised by the
    same numbers, which are to be kept with the module.

    Raises:
        ValueError: another policy.

    Example:
        >>> import torch
        >>> from stable_baselines3 import PPO
        >>> from inbounds.integrations.stable_baselines3 import LogitNormalPolicy
        >>> model = PPO(LogitNormalPolicy, "Pendulum-v1", n_steps=64, device="cpu", seed=0)
        >>> actor, obs = LogitNormalActor(model.policy), torch.randn(5, 3)
        >>> batch = {0: torch.export.Dim("batch", min=1, max=1024)}  # else five at a time, for ever
        >>> deployed = torch.export.export(actor, (obs,), dynamic_shapes=(batch,)).module()
        >>> one = obs[:1]
        >>> bool((deployed(one).detach().numpy() == model.predict(one.numpy(), deterministic=True)[0]).all())
        True
    """

    def __init__(self, policy: LogitNormalPolicy) -> None:
        if not isinstance(policy, LogitNormalPolicy):
            raise ValueError(
                f"LogitNormalActor takes a LogitNormalPolicy, as model.policy, and not {policy!r}"
            )
        super().__init__()
        self.see, self.think, self.head = (
            policy.pi_features_extractor,
            policy.mlp_extractor,
            policy.action_net,
        )
        self.eval()  # `learn` leaves the layers in training mode, in which dropout is random
        low, high = policy._limits(next(policy.action_net.parameters()))
        smallest, largest = open_ends(low, high)
        bounds = {"low": low, "high": high, "smallest": smallest, "largest": largest}
        for name, bound in bounds.items():
            self.register_buffer(name, bound)
        self.low: Tensor
        self.high: Tensor
        self.smallest: Tensor
        self.largest: Tensor

    def forward(self, obs: Tensor) -> Tensor:
        """Return the medians `[B, A]`, strictly inside the box."""
        latent = self.head(self.think.forward_actor(self.see(obs)))
        return from_line(latent, self.low, self.high, (self.smallest, self.largest))


def _floating(array: NDArray[Any]) -> Tensor:
    tensor = torch.as_tensor(array)
    return tensor if tensor.is_floating_point() else tensor.to(torch.get_default_dtype())


def quiet_start(model: Any, std: float = 0.4) -> Any:
    """Centre an untrained policy in its box and give its actions the standard deviation std; call it before `learn`.

    The peer starts with log σ = 0 and a spread of μ of about 0.01, both in the box's units for its own Gaussian,
    whatever the box. Here the free log σ is set, and the bias of the head of μ; the weights of the Gaussian's head
    are scaled by half the range. Of a Beta the bias of the head sets both concentrations. All are learned from there.
    Without the peer's `ortho_init` the outputs spread more, and so do the actions.

    Args:
        model: PPO, A2C or TRPO with the peer's own Gaussian, `LogitNormalPolicy` or `BetaPolicy`, on a bounded box.
        std: of the executed action, clipped or squashed, in units of half the action range.

    Returns:
        The same model.

    Raises:
        ValueError: no model, a policy of another kind or one that has been trained, or a std out of reach.

    Example:
        >>> from stable_baselines3 import PPO
        >>> model = quiet_start(PPO("MlpPolicy", "Pendulum-v1", n_steps=64, device="cpu", seed=0))
        >>> round(model.policy.log_std.exp().item(), 3)  # N·m, of a box of ±2: 0.4 of half the range, when clipped
        0.81
    """
    policy: Any = getattr(model, "policy", None)
    if policy is None:
        raise ValueError(f"quiet_start takes a model that is set up, quiet_start(PPO(…)), and not {model!r}")
    law = getattr(policy, "action_dist", policy)
    ours = isinstance(policy, BoundedPolicy)
    if not ours and type(law) is not DiagGaussianDistribution:
        raise ValueError(
            "quiet_start sets the σ of a Gaussian or a logit-normal or a Beta's concentrations, and this policy has "
            f"{type(law).__name__}"
        )
    moved = policy.ortho_init and policy.value_net.bias.any()  # which starts at 0: another model's weights
    if model.num_timesteps or policy.optimizer.state or moved:  # a trained model's optimiser has a state
        raise ValueError(
            f"quiet_start is for an untrained policy, and this one has learned ({model.num_timesteps} steps here): "
            "call it before `learn`, on a new model"
        )
    box: Any = model.action_space
    low, high = require_bounds(box.low.reshape(-1), box.high.reshape(-1))
    with torch.no_grad():
        if ours:
            law.start_quietly(policy, std)
        else:
            half, weight, scale = (high - low) / 2, policy.action_net.weight, quiet_scale(ClippedNormal, std)
            # A second call, perhaps after loading, sets the std alone.
            if not getattr(model, "started_quietly", False):
                model.started_quietly = True
                weight.mul_(half[:, None].to(weight))
            policy.log_std.copy_((half * scale).log())
            policy.action_net.bias.copy_((high + low) / 2)
    return model
