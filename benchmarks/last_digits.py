"""Do names depend on the last digits of a computation? Real rigs diagnosed as they are and with commands larger by a billionth.

``python -m benchmarks last_digits [RIG ...] [--draws 3] [--jobs 2]`` prints for every draw what ``flexdrive rigs`` would
name, the ties, and the error on report recordings. No recording tells a billionth of its command: what changes is a matter
of where fits end on a rough likelihood. Minutes a draw.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from baselines.real_rigs.entries import RIGS
from identification import diagnose
from identification.mismatch.answer.verdict import Diagnosis
from identification.recordings import RecordingSet

DATA = Path(__file__).parents[2] / "shared" / "recordings"
_BILLIONTH = 1e-9


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks last_digits", description=__doc__)
    parser.add_argument("rigs", nargs="*", choices=list(RIGS), metavar="RIG", default=["quanser_2dsfl", "ecp210_2025"])
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=None)
    given = parser.parse_args(sys.argv[2:])
    for name in given.rigs:
        rig = RIGS[name]
        if not (DATA / name).is_dir():
            print(f"{name}: skipped, no recordings in ../shared/recordings/{name}")
            continue
        recordings = rig.read(DATA)
        for draw in range(given.draws):
            moved = (replace(r, u=(1.0 + draw * _BILLIONTH) * r.u) for r in recordings)
            found = diagnose(
                RecordingSet(moved, recordings.skipped, recordings.rig), topology=rig.topology, jobs=given.jobs
            )
            print(f"{name}, command larger by {draw} ppb: {_said(found)}", flush=True)


def _said(found: Diagnosis) -> str:
    names = [" or ".join(f"{n.id}@{n.where}" for n in (finding, *finding.ties)) for finding in found.findings] or [
        "nothing named"
    ]
    return f"{found.before_rms:.4g} -> {found.after_rms:.4g}; {', '.join(names)}"
