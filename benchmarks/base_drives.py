"""How far off the base drive of a rig is that lacks nothing, by the metric that it is fitted in.

``python -m benchmarks base_drives [--first 1001] [--draws 24] [--jobs 2]``. Data sets are nulls of the independent rig simulator,
made from seeds that begin with the first one, whose friction differs from run to run, within a run and along the track. Every
drive is fitted by prediction errors; by output error, as a diagnosis reports it; and by that beside run-to-run variability
(:mod:`identification.mismatch.noise.marginal`), where each row is an independent error, or one in two seconds is, with amplitudes
as large as the noise has them or of usual size at most. Prints the rms of the errors of the parameters in per cent, and the rms
error of velocities in the report recordings relative to that by output error. 15 s a data set.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import joblib
import numpy as np

from baselines.rig_simulator.make import make_case
from identification import read_recordings
from identification.mismatch.answer.errors import velocity_rms
from identification.mismatch.diagnose import without_known
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Fit, fit
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.noise.estimate import Noise, estimate
from identification.mismatch.noise.marginal import marginal
from identification.mismatch.noise.nuisance import KNOT_S, Direction, directions
from identification.mismatch.selection.optima import fit_base
from identification.mismatch.selection.output_error import held_first, output_error
from identification.mismatch.settings import Settings
from identification.mismatch.split import split_recordings
from identification.selection import select
from identification.topology import topology_of

Errors = dict[str, float]
PLAIN = "output error"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks base_drives", description=__doc__)
    parser.add_argument("--first", type=int, default=1001)
    parser.add_argument("--draws", type=int, default=24)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(sys.argv[2:])
    if given.draws < 1:
        parser.error(f"argument --draws: must be at least 1; got {given.draws}. An rms error takes 20.")
    if given.first < 0 or given.jobs < 1:
        parser.error(f"arguments --first and --jobs: must be at least 0 and 1; got {given.first} and {given.jobs}.")
    seeds = range(given.first, given.first + given.draws)
    made = joblib.Parallel(n_jobs=given.jobs)(joblib.delayed(errors)(seed) for seed in seeds)
    names = list(made[0][PLAIN])
    print(f"{given.draws} null data sets from seed {given.first}; errors in per cent (rms)")
    print(f"{'':42s}" + "".join(f"{n:>8s}" for n in names))
    for metric in made[0]:
        rms = [float(np.sqrt(np.mean([m[metric][n] ** 2 for m in made]))) for n in names[:-1]]
        ratio = float(np.exp(np.mean([np.log(m[metric][names[-1]] / m[PLAIN][names[-1]]) for m in made])))
        print(f"{metric:42s}" + "".join(f"{100.0 * x:8.1f}" for x in rms) + f"{ratio:8.3f}")


def errors(seed: int) -> dict[str, Errors]:
    """Return the logarithms of the parameters over the truth, and the error in the report recordings [mm/s], by metric."""
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        folder, truth = Path(name) / "recordings", Path(name) / "truth.json"
        make_case(folder, truth, seed, "null")
        rig = json.loads(truth.read_text(encoding="utf-8"))["drive"]
        split = split_recordings(select(read_recordings(folder)).require())
    with ThreadPool(1) as pool:
        bench = Bench(split.estimation, pool, Settings())
        base = fit_base(bench, *without_known(topology_of(bench.recordings)))
        found = directions(bench, base.values)
        noise = estimate(bench, base.values, base.residual, found)
        # amplitudes that much smaller beside errors of rows; all recordings of the simulator have rows of one length
        run = bench.runs[0]
        few = [replace(d, size=d.size * np.sqrt(run.block * run.sample_time / KNOT_S)) for d in found]
        usual = replace(noise, scale={group: min(size, 1.0) for group, size in noise.scale.items()})
        plain = output_error(bench, base)
        drives = {
            "prediction error": fit(bench, noise, base.values, base.names),
            PLAIN: plain,
            "beside variability": _beside(plain, noise, found),
            f"beside variability, one error in {KNOT_S:g} s": _beside(plain, noise, few),
            "the same, of usual size at most": _beside(plain, usual, few),
        }
        return {
            metric: {
                **{n: float(np.log(best.values[n] / rig[n])) for n in best.names},
                "report": velocity_rms(split.report, best.values, pool),
            }
            for metric, best in drives.items()
        }


def _beside(plain: Fit, noise: Noise, found: list[Direction]) -> Fit:
    best = plain
    for _ in range(2):
        metric = marginal(plain.bench, noise, found, best.residual)
        best = held_first(plain.bench, metric, best.values, best.names)
    return best
