"""How a diagnosis came to its names on one concealed data set: every round's candidates, and how widely null draws scatter.

``python -m benchmarks rounds SEED:NUMBER [...]`` makes the data set of that number of ``flexdrive blind --seed SEED``. It prints
what is concealed, then for every round the largest variances of whitened null draws in each recording (1 where linear noise is
all there is), the gain that chance can reach, and the leading candidates with gain and p-value. A minute each. It shows single
cases, which steer decisions and prove nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from baselines.blind_study.plan import plan
from baselines.rig_simulator.make import make_case
from identification import read_recordings
from identification.mismatch.diagnose import ALPHA, without_known
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.selection.ranking import Round
from identification.mismatch.selection.selector import Selector
from identification.mismatch.settings import Settings
from identification.mismatch.split import split_recordings
from identification.selection import select
from identification.topology import topology_of

TRIALS, _LEADING = 200, 6


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks rounds", description=__doc__)
    parser.add_argument("sets", nargs="+", metavar="SEED:NUMBER", type=_data_set)
    for seed, number in parser.parse_args(sys.argv[2:]).sets:
        trial = plan(TRIALS, seed)[number]
        with tempfile.TemporaryDirectory() as folder:
            truth, rig = Path(folder) / "truth.json", Path(folder) / "rig"
            make_case(rig, truth, trial.seed, trial.kind, trial.size, trial.effect)
            concealed = json.loads(truth.read_text(encoding="utf-8"))["effects"]
            names = [f"{e['id']} at {e['where']}, size {e['size']:g}" for e in concealed]
            print(f"\n{seed}:{number}: {'; '.join(names) or 'nothing concealed'}", flush=True)
            for i, step in enumerate(_rounds(rig, trial.seed)):
                _print(i, step)


def _data_set(text: str) -> tuple[int, int]:
    seed, _, number = text.partition(":")
    if not (seed.isdecimal() and number.isdecimal() and int(number) < TRIALS):
        raise argparse.ArgumentTypeError(
            f"must be a seed and a number below {TRIALS}, such as 16:12; got {text!r}. See docs/trial.md for studies' seeds."
        )
    return int(seed), int(number)


def _rounds(rig: Path, seed: int) -> tuple[Round, ...]:
    runs = split_recordings(select(read_recordings(rig)).require()).estimation
    with ThreadPool(len(os.sched_getaffinity(0))) as pool:
        plain, known = without_known(topology_of(runs))
        return Selector(Bench(runs, pool, Settings()), plain, known, ALPHA, seed, lambda _: None).run().rounds


def _print(number: int, step: Round) -> None:
    bench = step.base.bench
    print(f"  round {number + 1}: {'something' if step.accepted else 'nothing'} is significant")
    for name, modes in zip(bench.names, step.noise.spread, strict=True):
        # what is taken off a direction of variance l is 1 - 1 / sqrt(l)
        taken = np.sum(modes.astype(np.float64) ** 2, axis=0)
        wide = np.sort((1.0 - taken) ** -2.0)[::-1]
        print(f"    {name:28s} {' '.join(f'{v:.0f}' for v in wide[:4]) or '1'}")
    for s in step.scored[:_LEADING]:
        print(f"    {' at '.join(s.name):64s} {s.total:8.1f}  p = {s.p:.4f}")
