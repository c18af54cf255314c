"""PPO on a batch of drives whose parameters vary, in fifteen lines."""

import sys

from stable_baselines3 import PPO

from baselines.rl.vec_env import FlexDriveVecEnv

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 500_000
ranges = {"m2": (3e-4, 4e-4), "d1": (0.3, 0.42), "d2": (0.2, 0.3)}
env = FlexDriveVecEnv(64, sensing="non_collocated", randomise=ranges, reference="random_moves")
model = PPO("MlpPolicy", env, n_steps=32, batch_size=512, gamma=0.99, seed=0)
model.learn(steps)

test = FlexDriveVecEnv(16, sensing="non_collocated")
test.seed(1)
observation, total = test.reset(), 0.0
for _ in range(800):
    observation, reward, done, infos = test.step(model.predict(observation, deterministic=True)[0])
    total += float(reward.mean())
print(f"mean return over the handout's trajectory after {steps} steps: {total:.0f}")
