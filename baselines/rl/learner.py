"""The learner: proximal policy optimisation, fitted to a drive that friction holds.

Four things matter more than the algorithm's usual settings (``docs/agents.md`` has the measurements):

* The policy begins as P-control at half its critical gain. A policy that begins at zero commands less than friction holds.
* Exploration is not learnt but shrinks on a schedule. Noise at 200 Hz is dither that frees the carts; a policy that learns
  with much of it vibrates or sticks without it.
* Rewards are scaled so that the value's error does not take the gradient's whole length, to which both networks are cut together.
* The network sees a short history, in differences (``features``): it needs an observer for the cart that no encoder sees.
"""

from __future__ import annotations

from math import log
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from baselines.rl.features import ERROR_MM, features
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym.recording import FloatArray

# PPO (Schulman et al. 2017). A rollout is half a period of the spring's vibration long, and can move the policy only so far:
# many rollouts of few drives learn faster than few rollouts of many
ROLLOUT = 32
MINIBATCHES = 8
EPOCHS = 5
LEARNING_RATE = 1.5e-3
LEAST_RATE = 0.02
DISCOUNT = 0.99
GAE = 0.95
LARGEST_KL = 0.03
LARGEST_GRADIENT = 1.0
HIDDEN = (64, 64)
ACTIVATION = "tanh"
# of the command over its limit, at the beginning and at the end
EXPLORATION = (0.135, 0.03)

# the environment's reward is -1 for an error of 10 mm; see the module's docstring
SCALE = 0.01
REWARD = {"tracking": SCALE, "effort": 0.01 * SCALE, "rate": 0.05 * SCALE, "failure": 100.0 * SCALE}

_FIRST_FIT = {"steps": 600, "batch": 512, "rate": 3e-3, "spread": 2.0}


class FixedFeatures(BaseFeaturesExtractor):
    """The constant linear map of :mod:`baselines.rl.features` before both networks."""

    def __init__(self, observation_space: Any, matrix: FloatArray) -> None:
        super().__init__(observation_space, len(matrix))
        self.register_buffer("matrix", torch.as_tensor(np.ascontiguousarray(matrix.T), dtype=torch.float32))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the networks' inputs."""
        return observations @ self.get_buffer("matrix")


def learner(env: FlexDriveVecEnv, history: int, *, seed: int, gain: float) -> PPO:
    """Return PPO at the beginning of a training.

    Parameters
    ----------
    env
        In physical units, with this history.
    seed
        Of weights, exploration and drives.
    gain
        Of the P-control as which the policy begins [V/mm].
    """
    matrix = features(env.batch.task, history)
    model = PPO(
        "MlpPolicy", env, seed=seed, device="cpu", n_steps=ROLLOUT, batch_size=max(2, ROLLOUT * env.num_envs // MINIBATCHES),
        n_epochs=EPOCHS, gamma=DISCOUNT, gae_lambda=GAE, learning_rate=rate, max_grad_norm=LARGEST_GRADIENT,
        target_kl=LARGEST_KL,
        policy_kwargs={
            "net_arch": {"pi": list(HIDDEN), "vf": list(HIDDEN)}, "activation_fn": torch.nn.Tanh,
            "log_std_init": log(EXPLORATION[0]), "features_extractor_class": FixedFeatures,
            "features_extractor_kwargs": {"matrix": matrix},
        },
    )  # fmt: skip
    model.policy.log_std.requires_grad_(False)
    begin_as_p_control(_actor(model), gain, env.batch.task.voltage, seed)
    return model


def explore(model: PPO, done: float) -> None:
    """Set the exploration for a training of which the share ``done`` is behind it."""
    first, last = (log(value) for value in EXPLORATION)
    model.policy.log_std.data.fill_(first + (last - first) * min(done, 1.0))


def layers(model: PPO) -> list[tuple[FloatArray, FloatArray]]:
    """Return the actor's (W, b) over the observation in physical units, the features folded into the first."""
    matrix = _array(model.policy.features_extractor.get_buffer("matrix")).T
    linear = [m for m in _actor(model) if isinstance(m, torch.nn.Linear)]
    found = [(_array(m.weight), _array(m.bias)) for m in linear]
    first, bias = found[0]
    return [(first @ matrix, bias), *found[1:]]


def _array(tensor: torch.Tensor) -> FloatArray:
    return np.asarray(tensor.detach().numpy(), dtype=np.float64)


def _actor(model: PPO) -> torch.nn.Sequential:
    return torch.nn.Sequential(*model.policy.mlp_extractor.policy_net, model.policy.action_net)


def rate(remaining: float) -> float:
    """Return the learning rate when the share ``remaining`` of a training is to come."""
    return LEARNING_RATE * max(LEAST_RATE, remaining)


def begin_as_p_control(actor: Any, gain: float, voltage: float, seed: int) -> None:
    """Fit an actor over the features, the first of which is the error, to P-control.

    Parameters
    ----------
    actor : torch.nn.Sequential
        Of layers.
    gain
        [V/mm].
    voltage
        Command at action 1 [V].
    seed
        Of the inputs it is fitted on.
    """
    slope = gain * ERROR_MM / voltage
    rng = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.Adam(actor.parameters(), lr=_FIRST_FIT["rate"])
    for _ in range(int(_FIRST_FIT["steps"])):
        x = torch.randn(int(_FIRST_FIT["batch"]), actor[0].in_features, generator=rng) * _FIRST_FIT["spread"]
        loss: Any = torch.mean((actor(x) - slope * x[:, :1]) ** 2)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
