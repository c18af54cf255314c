"""PPO on a batch of drives whose parameters vary, in fifteen lines; then the policy against Lab 4 and P-control.

So few steps on plain rewards show the way and learn little; what makes a policy good is in docs/agents.md and `flexdrive train`.
"""

import sys

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from baselines.compare import compare, entries
from baselines.rl.sb3 import controller_of
from baselines.rl.vec_env import FlexDriveVecEnv
from flexdrive_gym import DEFAULT_DRIVE

torch.set_num_threads(1)  # more only wait for each other on such a small network
steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000


class Progress(BaseCallback):
    """Says ten times how far it is, and how good the last episodes were."""

    def _on_step(self) -> bool:
        if self.num_timesteps * 10 // steps > (self.num_timesteps - env.num_envs) * 10 // steps:
            returns = [episode["r"] for episode in self.model.ep_info_buffer]
            mean = f", mean return of the last episodes {sum(returns) / len(returns):.0f}" if returns else ""
            print(f"{self.num_timesteps} of {steps} steps{mean}", flush=True)
        return True


ranges = {"m2": (3e-4, 4e-4), "d1": (0.3, 0.42), "d2": (0.2, 0.3)}
env = FlexDriveVecEnv(64, sensing="non_collocated", randomise=ranges, reference="random_moves")
model = PPO("MlpPolicy", env, n_steps=32, batch_size=512, gamma=0.99, seed=0)
model.learn(steps, callback=Progress())

test = FlexDriveVecEnv(16, sensing="non_collocated")
test.seed(1)
observation, total = test.reset(), 0.0
for _ in range(800):
    observation, reward, done, infos = test.step(model.predict(observation, deterministic=True)[0])
    total += float(reward.mean())
print(f"mean return over the handout's trajectory after {steps} steps: {total:.0f}")

# the same policy as a controller on the rig, against designs
others = {entry.name: entry for entry in entries(DEFAULT_DRIVE, ("p_x2", "lab4"))[0]}
mine = {"mine": controller_of(model, test)}
print(
    compare(DEFAULT_DRIVE, mine | others, draws=0, effects=False, references=(), empirical=False, backend="sequential")
)
