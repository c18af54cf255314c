"""Steps per second of the environments as ratios to Gymnasium's own, taking turns in one process on one thread."""

import subprocess
import sys
from collections.abc import Callable
from time import perf_counter, thread_time

import gymnasium
import numpy as np

import flexdrive_gym  # noqa: F401  (registers the environments)
from benchmarks.speed import median_seconds
from flexdrive_gym.fleet import OUTPUTS

ID = "FlexDrive-NonCollocated-v0"
SINGLE_STEPS, SAMPLES = 20_000, 16
ROUND, ROUNDS = 4e-3, 101
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


def stepping(
    env: gymnasium.vector.VectorEnv, advance: Callable[[np.ndarray], object] | None = None
) -> Callable[[int], None]:
    """A job of so many steps of a batch, after a reset; ``advance`` does what shall be timed instead of ``env.step``."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SAMPLES)]
    step = advance or env.step

    def job(calls: int) -> None:
        for i in range(calls):
            step(actions[i % SAMPLES])

    return job


def turns(jobs: list[Callable[[int], None]], clock: Callable[[], float] = thread_time) -> list[np.ndarray]:
    """Seconds per call of every job in every round, the jobs taking turns.

    By the processor's time of this thread, so that what other programs take in between does not count. They still slow
    a shared core down, but neighbouring short rounds alike: compare jobs round by round.
    """
    calls = []
    for job in jobs:
        job(20)
        begin = clock()
        job(20)
        calls.append(max(1, round(20 * ROUND / (clock() - begin))))
    times: list[list[float]] = [[] for _ in jobs]
    for _ in range(ROUNDS):
        for job, many, own in zip(jobs, calls, times, strict=True):
            begin = clock()
            job(many)
            own.append((clock() - begin) / many)
    return [np.array(own) for own in times]


def budget(n: int = 16384) -> None:
    """Print where the time of a 1 ms step goes, per drive, and what its memory traffic alone would take."""
    envs = [_batched(ID, n, control_period=1e-3, duration=100.0).unwrapped for _ in range(3)]

    def kernel(env: gymnasium.vector.VectorEnv, action: np.ndarray) -> None:
        env.fleet.actions[:] = action[:, 0]
        env.fleet.kernel(env.fleet.outputs.addresses[0], env.fleet.z)

    # driven one way for 0.3 s all carts slide on without an event
    steady = np.full((n, 1), 0.6, dtype=np.float32)
    arrays, out = envs[0].fleet.arrays, envs[0].fleet.outputs
    traffic = 2 * (arrays["state"].nbytes + arrays["clock"].nbytes) + arrays["actions"].nbytes + arrays["begin"].nbytes
    traffic += sum(getattr(out, name).nbytes for name in OUTPUTS)
    block = np.zeros(traffic // 16)
    jobs = {
        "step": stepping(envs[0]),
        "kernel": stepping(envs[1], lambda action: kernel(envs[1], action)),
        "kernel without events": stepping(envs[2], lambda _action: kernel(envs[2], steady)),
        "memory traffic alone": stepping(envs[2], lambda _action: np.negative(block, out=block)),
    }
    for job in jobs.values():
        job(300)
    for name, times in zip(jobs, turns(list(jobs.values())), strict=True):
        print(f"{n:6d} × 1 ms, {name}: {1e9 * np.quantile(times, 0.25) / n:5.2f} ns per drive")
    print(f"{n:6d} × 1 ms, bytes read and written: {traffic / n:.0f} per drive")


def main() -> None:
    footprint()
    jobs = {name: single(gymnasium.make(name)) for name in (ID, "CartPole-v1", "Pendulum-v1")}
    for job in jobs.values():
        job()  # type: ignore[operator]
    seconds = median_seconds(jobs, 7)
    own = SINGLE_STEPS / seconds[ID]
    for peer, aim in (("CartPole-v1", 8.0), ("Pendulum-v1", 12.0)):
        ratio = own / (SINGLE_STEPS / seconds[peer])
        print(f"single, 5 ms: {own / 1e3:7.0f}k steps/s, {ratio:5.2f} × {peer} (aim {aim:g})")
    for (label, n), aim in AIMS.items():
        period = 1e-3 if label == "1 ms" else 5e-3
        own, peer = turns([stepping(_batched(ID, n, control_period=period)), stepping(_batched("CartPole-v1", n))])
        low, ratio, high = np.quantile(peer / own, (0.25, 0.5, 0.75))
        print(
            f"{n:6d} × {label}: {n / np.median(own) / 1e6:6.2f}M steps/s, {ratio:5.2f} × CartPole's batch "
            f"({low:.2f} to {high:.2f} in half of the rounds; aim {aim:g})"
        )
    budget()
    one, two = turns([stepping(_batched(ID, 16384, threads=k)) for k in (1, 2)], perf_counter)
    print(f" 16384 × 5 ms: {np.median(one) / np.median(two):5.2f} × as fast on two threads as on one (aim 0.8)")


def footprint() -> None:
    """Print what importing costs beyond numpy and gymnasium, and what a drive of a randomised batch takes."""
    code = (
        "import time, numpy, gymnasium; t = time.process_time(); import flexdrive_gym; print(time.process_time() - t)"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(5)]
    print(f"import: {np.median([float(r.stdout) for r in runs]):.2f} s of CPU beyond numpy and gymnasium (aim 0.3)")
    env = _batched(ID, 1000, randomise={"m1": (6e-4, 9e-4)})
    fleet = env.unwrapped.fleet
    used = sum(array.nbytes for name, array in fleet.arrays.items() if name != "lookup")
    used += sum(getattr(fleet.outputs, name).nbytes for name in OUTPUTS)
    print(f"memory: {used / 1000:.0f} bytes per drive of a randomised batch (aim 1 kB)")


def _batched(name: str, n: int, **arguments: object) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(name, num_envs=n, vectorization_mode="vector_entry_point", **arguments)
