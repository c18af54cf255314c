"""Environment steps per second with all the learning included, on one thread of torch."""

import time

import torch

from baselines.rl.learner import ROLLOUT, learner
from baselines.rl.training import Plan, starting_gain, training_drives
from flexdrive_gym import DEFAULT_DRIVE

AIM, DRIVES = 20_000, 1024
ROLLOUTS, ROUNDS = 3, 5


def main() -> None:
    plan = Plan(envs=DRIVES)
    torch.set_num_threads(plan.threads)
    env = training_drives(DEFAULT_DRIVE, plan)
    model = learner(env, plan.history, seed=0, gain=starting_gain(DEFAULT_DRIVE))
    steps = ROLLOUTS * ROLLOUT * plan.envs
    model.learn(steps)  # compiles, and warms up
    rates, own = [], []
    for _ in range(ROUNDS):
        clock, work = time.perf_counter(), time.process_time()
        model.learn(steps, reset_num_timesteps=False)
        rates.append(steps / (time.perf_counter() - clock))
        own.append(steps / (time.process_time() - work))
    print(
        f"PPO with {plan.envs} drives, one thread: {max(rates) / 1e3:.0f}k environment steps/s including learning "
        f"(aim {AIM / 1e3:.0f}k); {max(own) / 1e3:.0f}k per second of CPU; best of {ROUNDS} rounds of {steps}"
    )
