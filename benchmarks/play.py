"""Does a reading stand still after its cart has reversed? The mark of play, read from the recordings themselves, without a model.

``python -m benchmarks play [FOLDER]`` prints for every recording with velocities, and for each cart, how long the velocity stays
within a count of zero before and after it changes its sign, and the speed 2 ms after that. Dry friction may hold a cart, but
lets it go from rest: its speed then grows from zero. Play lets go of a cart that moves already: the reading jumps.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

from flexdrive_gym import Recording
from flexdrive_gym.recording import FloatArray
from identification import read_recordings

DATA = Path(__file__).parents[2] / "shared" / "recordings" / "mte360_2022"
# fewer reversals say nothing
_FEWEST = 8
# longer than this a cart rests, whatever holds it [s]
_LONGEST_S = 0.03
_AFTER_S = 0.002


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks play", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=DATA)
    folder = parser.parse_args(sys.argv[2:]).folder
    if not folder.is_dir():
        parser.error(f"FOLDER: must hold recordings; {folder} does not exist. Name the folder of one rig.")
    print(
        "| recording | cart | reversals | still before [ms] | still after [ms] | then [mm/s] |\n|---|---|---|---|---|---|"
    )
    for recording in read_recordings(folder):
        for c, v in enumerate((recording.v1, recording.v2)):
            if v is not None and (row := _row(recording, c, v)):
                print(row)


def _row(recording: Recording, c: int, v: FloatArray) -> str | None:
    """Return the medians over all reversals of a cart, if there are enough."""
    h = recording.sample_time
    count = recording.quantum[c] / h if recording.quantum else 0.0
    moving = np.abs(v) > 1.5 * count
    places = np.flatnonzero(moving)
    turns = [(a, b) for a, b in pairwise(places) if v[a] * v[b] < 0.0 and b - a < _LONGEST_S / h]
    ahead = max(1, round(_AFTER_S / h))
    found = [(*_still(v, a, b), abs(v[b + ahead])) for a, b in turns if b + ahead < len(v)]
    if count == 0.0 or len(found) < _FEWEST:
        return None
    before, after, speed = np.median(found, axis=0)
    return (
        f"| {recording.name} | {c + 1} | {len(found)} | {1e3 * h * before:.1f} | {1e3 * h * after:.1f} | {speed:.1f} |"
    )


def _still(v: FloatArray, a: int, b: int) -> tuple[int, int]:
    """Return how many samples lie between the last motion one way, the change of sign, and the first motion the other way.

    The sign counts as changed where a straight line through the last 10 samples before meets zero.
    """
    n = np.arange(max(0, a - 9), a + 1)
    slope, offset = np.polyfit(n, v[n], 1)
    zero = -offset / slope if slope * v[a] < 0.0 else a + 1.0
    zero = float(np.clip(zero, a, b))
    return round(zero - a), round(b - zero)
