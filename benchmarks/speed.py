"""Speed of the compiled step, as ratios against named peers, measured in turns in one process."""

import time
from functools import partial

import control
import numpy as np

from baselines.loop_analysis.stability_limit import swings
from flexdrive_gym import Drive
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.effects import EFFECTS, WORKSPACE
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.references import square
from identification.replay.batch import RunBatch
from identification.replay.output_error import prepare
from tests.drive.drives import RIG
from tests.drive.reference import TwoMasses

T = np.arange(8001) * 1e-3


def median_seconds(jobs: dict[str, object], rounds: int) -> dict[str, float]:
    """Median seconds of each job, the jobs taking turns so that a drifting machine hits all alike."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            begin = time.perf_counter()
            job()  # type: ignore[operator]
            times[name].append(time.perf_counter() - begin)
    return {name: float(np.median(values)) for name, values in times.items()}


def nanoseconds(values: dict[str, float], *, full: bool = False, rounds: int = 5) -> tuple[float, int]:
    """Shortest time of a 1 ms sample in the open loop, and how many steps it takes."""
    u = square(T, 1.5, 0.5)
    z = np.zeros(WORKSPACE) if full else parameters.workspace(values)
    steps = parameters.substeps(values, 1e-3, 1e-3)
    readings, memory, p = np.empty((4, len(u))), np.zeros(WORK_SPACE), parameters.vector(values)
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        kernels.run_open_loop(u, 1e-3, steps, np.zeros(4), memory, z, p, readings)
        times.append(time.perf_counter() - begin)
    return 1e9 * min(times) / len(u), steps


def effects() -> None:
    """Print what a 1 ms sample costs with one effect present, and with all."""
    begin = time.perf_counter()
    nanoseconds(RIG, rounds=1)
    middle = time.perf_counter()
    nanoseconds(RIG, full=True, rounds=1)
    print(
        f"open loop compiled or loaded in {middle - begin:.1f} s, with all effects in {time.perf_counter() - middle:.1f} s"
    )
    rows = {"base": nanoseconds(RIG), "all effects compiled in, none present": nanoseconds(RIG, full=True)}
    everything = dict(RIG)
    for effect in EFFECTS:
        if effect.base:
            continue
        own = {effect.key(w, q.name): q.starts[0] for w in effect.where[:1] for q in effect.parameters}
        rows[effect.id] = nanoseconds({**RIG, **own})
        everything |= {effect.key(w, q.name): q.starts[0] for w in effect.where for q in effect.parameters}
    rows["every effect at once"] = nanoseconds(everything)
    for name, (cost, steps) in rows.items():
        print(f"{name:40s} {cost:8.0f} ns a sample of 1 ms, {steps} steps")


def in_lanes() -> None:
    """Print what a sample of four recordings costs, replayed in lanes and one by one, and how much they differ."""
    t = np.arange(8001) * 1e-3
    rig = Drive(RIG)
    runs = [
        prepare(rig.simulate(t, a * np.sin(2 * np.pi * f * t)))
        for a, f in ((2.5, 0.5), (2.5, 2.0), (2.5, 8.0), (1.2, 1.0))
    ]
    day, nowhere = RunBatch(runs), np.zeros(len(runs))
    for name in ("base effects", "presliding", "stribeck", "cogging", "hardening_spring", "tilt", "extra_mode"):
        own = [e for e in EFFECTS if e.id == name]
        values = {**RIG, **{e.key(w, q.name): q.starts[0] for e in own for w in e.where[:1] for q in e.parameters}}
        lanes = partial(day.residual, values, nowhere)
        single = [partial(day.residual, values, nowhere, i, i + 1) for i in range(len(runs))]
        apart = np.abs(lanes() - np.concatenate([one() for one in single])).max()
        seconds = median_seconds({"lanes": lanes, **{str(i): one for i, one in enumerate(single)}}, 25)
        together = seconds.pop("lanes")
        alone, samples = sum(seconds.values()), sum(len(run.u) for run in runs)
        print(
            f"{name:20s} {1e9 * together / samples:6.0f} ns a sample in lanes, {1e9 * alone / samples:6.0f} ns one by one, "
            f"{alone / together:4.1f} ×, largest difference {apart:g}"
        )


def main() -> None:
    drive = Drive({**RIG, "saturation.limit": 8.0})
    u = square(T, 1.5, 0.5)
    plant = drive.linear.state_space()
    inputs = np.vstack([u, np.zeros((2, len(u)))])
    gains = np.geomspace(0.01, 0.5, 100)
    jobs = {
        "flexdrive, 8 s at 1 kHz with dry friction": lambda: drive.simulate(T, u),
        "python-control forced_response, linear": lambda: control.forced_response(plant, T, inputs),
        "flexdrive, sweep of 100 gains × 12 s": lambda: swings(drive, gains, "x2"),
    }
    for job in jobs.values():
        job()  # compile, or load what was compiled
    median = median_seconds(jobs, 15)
    begin = time.perf_counter()
    TwoMasses(**RIG).run(T, u)
    median["scipy DOP853, event-driven, same friction"] = time.perf_counter() - begin
    own = median["flexdrive, 8 s at 1 kHz with dry friction"]
    for name, seconds in median.items():
        print(f"{name:45s} {1e3 * seconds:10.3f} ms   {seconds / own:8.1f} ×")
    steps = len(gains) * 12000 / median["flexdrive, sweep of 100 gains × 12 s"]
    print(f"closed-loop sweep: {steps / 1e6:.1f} million steps/s on one thread")
    effects()
    in_lanes()
