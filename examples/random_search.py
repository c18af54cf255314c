"""A batched random search for the best P and D gains on the collocated drive: 512 candidates, one episode each."""

import gymnasium
import numpy as np

import flexdrive_gym  # noqa: F401  (registers the environments)

n = 512
rng = np.random.default_rng(0)
P, D = rng.uniform(0.05, 1.0, n), rng.uniform(0.0, 0.02, n)  # V/mm, V s/mm
env = gymnasium.make_vec(
    "FlexDrive-Collocated-v0", num_envs=n, vectorization_mode="vector_entry_point", autoreset_mode="disabled"
)
observation, _info = env.reset(seed=0)
total, alive = np.zeros(n), np.ones(n, dtype=bool)
for _ in range(env.task.horizon):
    u = P * observation[:, 2] - D * observation[:, 1]  # error and velocity of cart 1
    observation, reward, terminated, truncated, _info = env.step((u / env.task.voltage)[:, None].astype(np.float32))
    total += np.where(alive, reward, 0.0)
    alive &= ~terminated
best = int(np.argmax(np.where(alive, total, -np.inf)))
print(f"best of {n}: P = {P[best]:.3f} V/mm, D = {D[best]:.4f} V s/mm, return {total[best]:.0f}")
