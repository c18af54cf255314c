"""How often a diagnosis names physics where none is left out, and how often its p-values are small there.

``python -m benchmarks false_alarms [--kind generator|rig] [--draws 500] [--jobs 2] [--alpha 0.02]``. Null data sets are of two
kinds: those of the independent rig simulator that conceal nothing (``generator``), and the rig's own (``rig``): the base model's
simulation of every recording of ``../shared/recordings/mte360_2022``, plus what the diagnosed drive leaves there, its sign drawn
for each recording. Every draw is kept in the cache directory under the digest of the code, so an interrupted run goes on where it
stopped. Writes a plot of the p-values to ``benchmarks/out``.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import joblib
import numpy as np
from matplotlib.figure import Figure
from platformdirs import user_cache_path

from baselines.blind_study.study import engine
from baselines.evaluation.proportions import share
from baselines.rig_simulator.make import make_case
from flexdrive_gym import Recording
from flexdrive_gym.files import write_atomically
from flexdrive_gym.recording import FloatArray
from identification import diagnose, read_recordings
from identification.mismatch.fitting.bench import Values, free
from identification.plots.style import new_figure, save_png
from identification.replay.output_error import prepare, simulate_run

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "recordings" / "mte360_2022"
OUT = Path(__file__).parent / "out"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks false_alarms", description=__doc__)
    parser.add_argument("--kind", choices=list(NULLS), default="generator")
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--alpha", type=float, default=0.02)
    given = parser.parse_args(sys.argv[2:])
    if given.draws < 1:
        parser.error(f"argument --draws: must be at least 1; got {given.draws}. A calibration takes 500.")
    if given.kind == "rig" and not DATA.is_dir():
        print("skipped: no recordings in ../shared/recordings/mte360_2022")
        return
    folder = user_cache_path("flexdrive") / "false_alarms" / f"{engine()}-{given.kind}-{given.alpha:g}"
    todo = [d for d in range(given.draws) if not (folder / f"{d}.json").exists()]
    print(f"{given.kind}: {given.draws} draws, {given.draws - len(todo)} of them done before; results in {folder}")
    joblib.Parallel(n_jobs=given.jobs)(
        joblib.delayed(one)(given.kind, d, given.alpha, folder / f"{d}.json") for d in todo
    )
    results = [json.loads((folder / f"{d}.json").read_text()) for d in range(given.draws)]
    for r in results:
        if r["verdict"] != "no_mismatch":
            print(f"draw {r['draw']}: {r['verdict']}; {', '.join(r['findings']) or 'unnamed'}")
    print(
        f"data sets with a name: {share([bool(r['findings']) for r in results])}; at most {1.5 * given.alpha:.0%} asked for"
    )
    print(f"data sets with a name or something unnamed: {share([r['verdict'] != 'no_mismatch' for r in results])}")
    p = np.sort([r["p_value"] for r in results])
    print(f"wrote {save_png(_plot(p, given.kind), OUT / f'null_p_values_{given.kind}.png', 120)}")


def one(kind: str, draw: int, alpha: float, path: Path) -> None:
    begin = time.perf_counter()
    found = diagnose(NULLS[kind](draw), seed=draw, jobs=1, alpha=alpha)
    result = {
        "draw": draw,
        "verdict": found.verdict,
        "findings": [f.name for f in found.findings],
        "p_value": found.p_value,
        "seconds": time.perf_counter() - begin,
    }
    write_atomically(path, json.dumps(result))


def _of_generator(draw: int) -> Sequence[Recording]:
    with tempfile.TemporaryDirectory(prefix="flexdrive-") as name:
        folder = Path(name) / "recordings"
        make_case(folder, Path(name) / "truth.json", draw, "null")
        return read_recordings(folder)


@cache
def _rig() -> tuple[Sequence[Recording], Values, Values]:
    recordings = read_recordings(DATA)
    found = diagnose(recordings, jobs=1)
    return [r for r in recordings if not r.closed_loop], found.base.values, found.drive.values


def _of_rig(draw: int) -> Sequence[Recording]:
    recordings, base, drive = _rig()
    signs = np.random.default_rng(draw).choice([-1.0, 1.0], len(recordings))
    made = []
    for r, sign in zip(recordings, signs, strict=True):
        run = free(prepare(r))
        v = [
            b + sign * (m - d)
            for m, b, d in zip(run.measured, simulate_run(base, run), simulate_run(drive, run), strict=True)
        ]
        made.append(replace(r, x1=None, x2=None, v1=v[0], v2=v[1] if len(v) > 1 else None))
    return made


NULLS: dict[str, Callable[[int], Sequence[Recording]]] = {"generator": _of_generator, "rig": _of_rig}


def _plot(p: FloatArray, kind: str) -> Figure:
    figure = new_figure(3.0)
    axes = figure.subplots()
    axes.plot(p, np.arange(1, len(p) + 1) / len(p), drawstyle="steps-post", label=f"{len(p)} null data sets, {kind}")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.5", linewidth=0.8, label="uniform")
    axes.set_xlabel("p-value of the best candidate")
    axes.set_ylabel("share of data sets")
    axes.legend(loc="best")
    return figure
