"""PPO in one file, in the manner of CleanRL, straight on the batched environment: every line of the algorithm is here."""

import sys

import gymnasium
import numpy as np
import torch
from torch import nn

import flexdrive_gym  # noqa: F401  (registers the environments)

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
drives, rollout, epochs, minibatches, gamma, lam, clip = 256, 32, 5, 8, 0.99, 0.95, 0.2
torch.manual_seed(0)
torch.set_num_threads(1)
# small rewards, so that the value's error does not take the whole gradient
weights = {"tracking": 0.01, "effort": 1e-4, "rate": 5e-4, "failure": 1.0}
ranges = {"m2": (3e-4, 4e-4), "d1": (0.3, 0.42), "d2": (0.2, 0.3)}
env = gymnasium.make_vec(
    "FlexDrive-NonCollocated-v0", num_envs=drives, vectorization_mode="vector_entry_point", autoreset_mode="same_step",
    reference="random_moves", reward=weights, randomise=ranges, preview=(0.05, 0.1),
)  # fmt: skip
# x2, v2, xr - x2, xr, last u, xr in 0.05 s and in 0.1 s -> differences of the size of one
features = torch.zeros(7, 5)
for row, column, factor in (
    (2, 0, 0.2),
    (1, 1, 0.01),
    (4, 2, 0.5),
    (5, 3, 0.2),
    (3, 3, -0.2),
    (6, 4, 0.1),
    (3, 4, -0.1),
):
    features[row, column] = factor


def network(gain: float) -> nn.Sequential:
    made = nn.Sequential(nn.Linear(5, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))
    with torch.no_grad():
        made[-1].weight.mul_(gain)
    return made


actor, critic = network(0.01), network(1.0)
optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], lr=1e-3)
seen = torch.as_tensor(env.reset(seed=0)[0]) @ features
for iteration in range(max(1, steps // (rollout * drives))):
    std = 0.3 * (
        0.1 ** (iteration * rollout * drives / steps)
    )  # noise frees carts that stick, so it must go in the end
    rows = []
    with torch.no_grad():
        for _ in range(rollout):
            # from P-control at 0.08 V/mm on: a policy that begins at nothing is held by friction
            policy = torch.distributions.Normal(0.05 * seen[:, :1] + actor(seen), std)
            action = policy.sample()
            observation, reward, terminated, truncated, info = env.step(action.clamp(-1.0, 1.0).numpy())
            reward = torch.as_tensor(reward, dtype=torch.float32)
            if truncated.any():  # a time limit is no failure: what would have come is estimated
                last = torch.as_tensor(np.stack(info["final_obs"][truncated])) @ features
                reward[truncated] += gamma * critic(last).squeeze(1)
            done = torch.as_tensor(terminated | truncated)
            rows.append((seen, action, policy.log_prob(action), critic(seen).squeeze(1), reward, done))
            seen = torch.as_tensor(observation) @ features
        observations, actions, old, values, rewards, dones = (torch.stack(column) for column in zip(*rows, strict=True))
        following, advantage, advantages = critic(seen).squeeze(1), torch.zeros(drives), torch.zeros(rollout, drives)
        for t in reversed(range(rollout)):
            goes_on = 1.0 - dones[t].float()
            delta = rewards[t] + gamma * goes_on * following - values[t]
            advantage = delta + gamma * lam * goes_on * advantage
            advantages[t], following = advantage, values[t]
        returns = (advantages + values).reshape(-1)
    observations, actions, old, advantages = (
        x.reshape(rollout * drives, -1) for x in (observations, actions, old, advantages)
    )
    for _ in range(epochs):
        for some in torch.randperm(rollout * drives).chunk(minibatches):
            mean = 0.05 * observations[some, :1] + actor(observations[some])
            ratio = (torch.distributions.Normal(mean, std).log_prob(actions[some]) - old[some]).exp()
            a = (advantages[some] - advantages[some].mean()) / (advantages[some].std() + 1e-8)
            loss = torch.maximum(-a * ratio, -a * ratio.clamp(1.0 - clip, 1.0 + clip)).mean()
            loss = loss + 0.5 * (critic(observations[some]).squeeze(1) - returns[some]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], 1.0)
            optimizer.step()
    if iteration % 10 == 0:
        print(
            f"{(iteration + 1) * rollout * drives:8d} steps, mean reward {100 * float(rewards.mean()):.3f} (error of 10 mm: -1)"
        )

test = gymnasium.make_vec(
    "FlexDrive-NonCollocated-v0",
    num_envs=1,
    vectorization_mode="vector_entry_point",
    preview=(0.05, 0.1),
    physical_info=True,
)
observation, squares = test.reset(seed=1)[0], []
for _ in range(799):
    with torch.no_grad():
        x = torch.as_tensor(observation) @ features
        action = (0.05 * x[:, :1] + actor(x)).clamp(-1.0, 1.0).numpy()
    observation, _reward, _terminated, _truncated, info = test.step(action)
    squares.append(float(info["e"][0]) ** 2)
print(f"rms tracking error {np.sqrt(np.mean(squares)):.2f} mm on the handout's trajectory")
