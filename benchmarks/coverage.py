"""Round trip: simulate, identify, and count how often the truth lies inside the 95 % intervals.

Every draw is a new drive with a new data set of four squares and fourteen sines, encoder counts and raw-difference
velocities. Either all that disturbs it is a coloured force that the recorded command does not show, or it is a data set
of the concealed trial on which nothing is left out: a rough track, and friction that differs from run to run and wanders.
"""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.progress import track
from scipy.stats import binomtest

from baselines.lab.experiments import FREQUENCIES_HZ
from baselines.lab.sample.make import coloured_force
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig_simulator.make import make_case
from baselines.rig_simulator.truth import draw_truth
from flexdrive_gym import Drive, Excitation, Recording
from flexdrive_gym.references import sine, square
from identification import read_recordings
from identification.likelihood import identify_by_likelihood

DRAWS = 100
NAMES = ("m1", "m2", "b1", "b2", "d1", "d2", "k")
T = np.arange(8001) * 1e-3


def random_drive(rng: np.random.Generator) -> Drive:
    m1 = rng.uniform(4e-4, 8e-4)
    b1 = rng.uniform(0.006, 0.012)
    d1 = rng.uniform(0.25, 0.5)
    return with_rig(
        Drive(
            {
                "m1": m1,
                "m2": m1 * rng.uniform(0.4, 0.6),
                "b1": b1,
                "b2": b1 * rng.uniform(0.1, 0.35),
                "d1": d1,
                "d2": d1 * rng.uniform(0.1, 0.6),
                "k": rng.uniform(0.06, 0.12),
            }
        )
    )


def disturbed(drive: Drive, kind: str, amplitude: float, frequency: float, rng: np.random.Generator) -> Recording:
    u = (square if kind == "square" else sine)(T, amplitude, frequency)
    force = coloured_force(len(T), rng)
    run = drive.simulate(T, u + force, name=f"{kind} {amplitude} {frequency} {rng.integers(1 << 30)}")
    return replace(run, u=u, x1=None, x2=None, excitation=Excitation(kind, amplitude, frequency))  # type: ignore[arg-type]


def data_set(drive: Drive, rng: np.random.Generator) -> list[Recording]:
    runs = [disturbed(drive, "square", a, 0.5, rng) for a in (1.5, 1.5, 2.0, 2.0)]
    return runs + [disturbed(drive, "sine", 2.5, f, rng) for f in FREQUENCIES_HZ]


def shaken(seed: int) -> tuple[Drive, list[Recording]]:
    rng = np.random.default_rng(seed)
    drive = random_drive(rng)
    return drive, data_set(drive, rng)


def concealed(seed: int) -> tuple[Drive, list[Recording]]:
    with tempfile.TemporaryDirectory() as folder:
        make_case(Path(folder) / "data", Path(folder) / "truth.json", seed, "null")
        return Drive(dict(draw_truth(seed, "null").drive)), list(read_recordings(Path(folder) / "data"))


def main(draws: int = DRAWS) -> None:
    report("a coloured force", shaken, draws)
    report("a rough track and friction that differs from run to run", concealed, draws)


def report(what: str, made: Callable[[int], tuple[Drive, list[Recording]]], draws: int) -> None:
    inside = dict.fromkeys(NAMES, 0)
    errors: dict[str, list[float]] = {name: [] for name in NAMES}
    for seed in track(range(draws), description="round trips"):
        drive, recordings = made(seed)
        found = identify_by_likelihood(recordings)
        for name in NAMES:
            low, high = found.drive.intervals[name]
            inside[name] += low <= drive[name] <= high
            errors[name].append(found.drive[name] / drive[name] - 1.0)
    print(f"95 % intervals that hold the truth, {what}: {draws} draws (seeds 0 … {draws - 1})")
    for name in NAMES:
        ci = binomtest(inside[name], draws).proportion_ci(method="wilson")
        print(
            f"  {name:3s} {inside[name]:3d} of {draws}  [{ci.low:.0%}, {ci.high:.0%}]   "
            f"rms error {100 * np.sqrt(np.mean(np.square(errors[name]))):.2f} %"
        )
