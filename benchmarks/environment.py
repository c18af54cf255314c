"""Steps per second of the environments as ratios to Gymnasium's own, taking turns in one process on one thread."""

import subprocess
import sys

import gymnasium
import numpy as np

import flexdrive_gym  # noqa: F401  (registers the environments)
from benchmarks.speed import interleaved
from flexdrive_gym.fleet import OUTPUTS

ID = "FlexDrive-NonCollocated-v0"
SINGLE_STEPS, SAMPLES = 20_000, 16
AIMS = {
    ("1 ms", 64): 15.0, ("1 ms", 1024): 6.0, ("1 ms", 16384): 4.0,
    ("5 ms", 64): 12.0, ("5 ms", 1024): 2.5, ("5 ms", 16384): 1.5,
}  # fmt: skip


def single(env: gymnasium.Env) -> object:
    """A job of many steps with random actions and resets."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SAMPLES)]

    def job() -> None:
        for i in range(SINGLE_STEPS):
            _o, _r, terminated, truncated, _i = env.step(actions[i % SAMPLES])
            if terminated or truncated:
                env.reset()

    return job


def batch(env: gymnasium.vector.VectorEnv, calls: int) -> object:
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SAMPLES)]

    def job() -> None:
        for i in range(calls):
            env.step(actions[i % SAMPLES])

    return job


def main() -> None:
    footprint()
    jobs = {name: single(gymnasium.make(name)) for name in (ID, "CartPole-v1", "Pendulum-v1")}
    for job in jobs.values():
        job()  # type: ignore[operator]
    seconds = interleaved(jobs, 7)
    own = SINGLE_STEPS / seconds[ID]
    for peer, aim in (("CartPole-v1", 8.0), ("Pendulum-v1", 12.0)):
        ratio = own / (SINGLE_STEPS / seconds[peer])
        print(f"single, 5 ms: {own / 1e3:7.0f}k steps/s, {ratio:5.2f} × {peer} (aim {aim:g})")
    for (label, n), aim in AIMS.items():
        period = 1e-3 if label == "1 ms" else 5e-3
        calls = max(20, 200_000 // n)
        pair = {
            "own": batch(_batched(ID, n, control_period=period), calls),
            "peer": batch(_batched("CartPole-v1", n), calls),
        }
        for job in pair.values():
            job()  # type: ignore[operator]
        # many rounds: a round is so short that another program may take it all
        times = interleaved(pair, 31)
        rate, ratio = n * calls / times["own"], times["peer"] / times["own"]
        print(f"{n:6d} × {label}: {rate / 1e6:6.2f}M steps/s, {ratio:5.2f} × CartPole's batch (aim {aim:g})")
    pair = {str(k): batch(_batched(ID, 16384, threads=k), 20) for k in (1, 2)}
    times = interleaved(pair, 25)
    print(f" 16384 × 5 ms: {times['1'] / times['2']:5.2f} × as fast on two threads as on one (aim 0.8)")


def footprint() -> None:
    """Print what importing costs beyond numpy and gymnasium, and what a drive of a randomised batch takes."""
    code = (
        "import time, numpy, gymnasium; t = time.process_time(); import flexdrive_gym; print(time.process_time() - t)"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(5)]
    print(f"import: {np.median([float(r.stdout) for r in runs]):.2f} s of CPU beyond numpy and gymnasium (aim 0.3)")
    env = _batched(ID, 1000, randomise={"m1": (6e-4, 9e-4)})
    fleet = env.unwrapped.fleet
    used = sum(array.nbytes for name, array in fleet.arrays.items() if name != "references")
    used += sum(getattr(fleet.outputs, name).nbytes for name in OUTPUTS)
    print(f"memory: {used / 1000:.0f} bytes per drive of a randomised batch (aim 1 kB)")


def _batched(name: str, n: int, **arguments: object) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(name, num_envs=n, vectorization_mode="vector_entry_point", **arguments)
