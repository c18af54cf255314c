"""``python -m baselines.blind_study.diagnosing RECORDINGS RESULT SEED``: the diagnosis of one trial, in a process of its own.

It is given the folder of the recordings and nothing else, and writes one JSON file.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from baselines.loop_analysis.stability_limit import stability_limit
from flexdrive_gym import Drive
from flexdrive_gym.drive.toml import dumps
from flexdrive_gym.files import write_atomically
from identification import diagnose, read_recordings


def answer(recordings: Path, seed: int) -> dict[str, object]:
    """Return the diagnosis as in ``diagnosis.json``, the three drives, and the critical gain each predicts [V/mm]."""
    runs = read_recordings(recordings)
    found = diagnose(runs, seed=seed, jobs=1)
    assert found.tied is not None  # a trial's rig has two carts
    drives = {"tied": found.tied, "free": found.free, "diagnosed": found.drive}
    return {
        "diagnosis": found.as_json(),
        "drives": {name: dumps(drive) for name, drive in drives.items()},
        "critical_gains": {name: _critical_gain(drive) for name, drive in drives.items()},
    }


def _critical_gain(drive: Drive) -> float | None:
    return stability_limit(drive, "x2").critical_gain_simulated


def main(arguments: Sequence[str] | None = None) -> int:
    """Diagnose and write the answer."""
    recordings, result, seed = arguments if arguments is not None else sys.argv[1:]
    write_atomically(result, json.dumps(answer(Path(recordings), int(seed))))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
