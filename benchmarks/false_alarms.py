"""How often a diagnosis finds physics where there is none.

``python -m benchmarks false_alarms [--draws 100] [--jobs 2]`` simulates data sets of a drive without left-out physics, but as
restless as a real rig: the free fit of ``mte360_2022`` where its recordings are beside the repository, else the drive of the
bundled sample's size; with the nuisance forces of :mod:`identification.mismatch.chance`, scaled to the real floor, and
encoder counts. Every draw is kept in the cache directory under the digest of the code, so an interrupted run goes on where it
stopped.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import joblib
import numpy as np
from platformdirs import user_cache_path

from baselines.blind_study.study import engine
from baselines.evaluation.proportions import share
from baselines.lab.experiments import FREQUENCIES_HZ, open_loop
from flexdrive_gym import Drive, Recording
from flexdrive_gym.files import write_atomically
from flexdrive_gym.recording import FloatArray
from identification import diagnose, identify, read_recordings
from identification.mismatch.chance import nuisance
from identification.mismatch.crew import Crew
from identification.mismatch.surroundings import against
from identification.mismatch.workbench import Workbench
from identification.replay.output_error import prepare, simulate_run

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "recordings" / "mte360_2022"
QUANTUM = 0.0046592
# rms of what does not repeat on the real rigs, and of encoder counts as velocity [mm/s]
FLOOR_MM_S = {"mte360_2022": 2.9}
DEFAULT = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 0.0096, "b2": 0.0032, "d1": 0.357, "d2": 0.241, "k": 0.095}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks false_alarms")
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args(sys.argv[2:])
    name, values = rig()
    folder = user_cache_path("flexdrive") / "false_alarms" / f"{engine()}-{name}"
    todo = [d for d in range(options.draws) if not (folder / f"{d}.json").exists()]
    print(f"{name}: {options.draws} draws, {options.draws - len(todo)} of them done before; results in {folder}")
    joblib.Parallel(n_jobs=options.jobs)(joblib.delayed(one)(values, d, folder / f"{d}.json") for d in todo)
    results = [json.loads((folder / f"{d}.json").read_text()) for d in range(options.draws)]
    for r in results:
        if r["verdict"] != "no_mismatch":
            print(f"draw {r['draw']}: {r['verdict']}; {', '.join(r['findings']) or 'unnamed'}")
    print(f"verdicts other than no mismatch: {share([r['verdict'] != 'no_mismatch' for r in results])}")
    print(f"draws with a named finding: {share([bool(r['findings']) for r in results])}")
    print(
        f"floor of the draws {np.median([r['floor_rms'] for r in results]):.2f} mm/s (rig {FLOOR_MM_S['mte360_2022']} mm/s)"
    )


def rig() -> tuple[str, dict[str, float]]:
    if not DATA.is_dir():
        print("no ../shared/recordings/mte360_2022: a drive of the same size instead")
        return "default", DEFAULT
    found = identify(read_recordings(DATA)).drive
    return "mte360_2022", {n: found[n] for n in DEFAULT}


def one(values: dict[str, float], draw: int, path: Path) -> None:
    begin = time.perf_counter()
    found = diagnose(null_day(values, draw), seed=draw, jobs=1)
    result = {
        "draw": draw,
        "verdict": found.verdict,
        "findings": [f"{f.id}@{f.where}" for f in found.findings],
        "before_rms": found.before_rms,
        "floor_rms": found.floor_rms if np.isfinite(found.floor_rms) else 0.0,
        "seconds": time.perf_counter() - begin,
    }
    write_atomically(path, json.dumps(result))


def null_day(values: dict[str, float], seed: int) -> list[Recording]:
    """A data set of open-loop runs with nuisance and encoder counts, and nothing left out."""
    drive = Drive(values)
    kinds = [("square", a, 0.5) for a in (1.5, 1.5, 2.0, 2.0)] + [("sine", 2.5, f) for f in FREQUENCIES_HZ]
    quiet = [replace(open_loop(drive, *kind), name=f"{i:02d} {kind[0]}") for i, kind in enumerate(kinds)]  # type: ignore[arg-type]
    runs = [prepare(r) for r in quiet]
    with Crew(1) as pool:
        bench = Workbench(runs, pool)
        disturbances = nuisance(bench, values, [[against(v) for v in run.measured] for run in runs], seed)

    def disturbed(scale: float) -> list[FloatArray]:
        """Velocities of every run with the nuisance at a scale, ndarray, shape (2, n)."""
        found = []
        for run, d in zip(runs, disturbances, strict=True):
            changed = {k: max(values[k] + scale * (v - values[k]), 0.0) for k, v in d.changes.items() if k in values}
            found.append(np.array(simulate_run({**values, **changed}, run, pushes=scale * d.force)))
        return found

    plain, moved = disturbed(0.0), disturbed(1.0)
    # the mixture is drawn, its size is the rig's: what remains between runs of the same command
    size = float(np.sqrt(np.mean([np.mean((m - p) ** 2) for m, p in zip(moved, plain, strict=True)])))
    scale = FLOOR_MM_S["mte360_2022"] / max(size, 1e-9)
    day = []
    for r, v in zip(quiet, disturbed(scale), strict=True):
        # counts of the encoder, differentiated as the rig does it
        x = [np.round(np.cumsum(s) * 1e-3 / QUANTUM) * QUANTUM for s in v]
        raw = [np.diff(c, prepend=0.0) / 1e-3 for c in x]
        day.append(replace(r, v1=raw[0], v2=raw[1], quantum=(QUANTUM, QUANTUM)))
    return day
