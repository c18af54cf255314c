"""Is a concealed data set's nuisance like a real rig's? Floor, free fit and run-to-run spread of friction, side by side.

``python -m benchmarks blind_nuisance`` looks for real recordings in ``../shared/recordings`` beside the repository.
"""

import tempfile
from pathlib import Path

import numpy as np

from baselines.rig_simulator.make import make_case
from flexdrive_gym import Recording
from identification import identify_by_likelihood, read_recordings
from identification.floor import measure_floor

DATA = Path(__file__).parents[2] / "shared" / "recordings"
NULLS = 8


def main() -> None:
    print(
        "floor: what does not repeat between periods and replicates [mm/s]; fit: rms of a free fit, every effect of a"
    )
    print("real rig still inside; spread: of dry friction between replicates of the squares, one standard deviation")
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(NULLS):
            make_case(Path(folder) / f"null_{seed}", Path(folder) / f"{seed}.json", seed, "null")
        folders = sorted(Path(folder).glob("null_*"))
        if DATA.is_dir():
            folders = [DATA / "mte360_2022", DATA / "mte360_2025", *sorted((DATA / "blind").glob("case_*")), *folders]
        for path in folders:
            print(line(path.name, read_recordings(path)))


def line(name: str, runs: list[Recording]) -> str:
    floors = [f.rms for f in measure_floor(runs) if np.isfinite(f.rms)]
    fit = identify_by_likelihood(runs)
    return (
        f"{name:14s} floor {np.sqrt(np.mean(np.square(floors))):5.2f} (median {np.median(floors):4.2f})   "
        f"fit {fit.rms:5.2f}   spread {spread(runs, dict(fit.drive.values)):5.1%}"
    )


def spread(runs: list[Recording], values: dict[str, float]) -> float:
    """Relative spread of d1 + d2 between squares of one amplitude, all else held at the data set's fit."""
    fixed = {n: values[n] for n in ("m1", "m2", "k", "b1", "b2")}
    ratio = values["d2"] / values["d1"]
    groups: dict[float, list[float]] = {}
    for run in runs:
        if run.excitation.kind == "square" and run.excitation.amplitude > 1.2:
            found = identify_by_likelihood([run], fixed=fixed, ties={"gamma": ratio})
            groups.setdefault(round(run.excitation.amplitude, 2), []).append(found.drive["d1"])
    relative = [np.var(d, ddof=1) / np.mean(d) ** 2 for d in groups.values() if len(d) > 1]
    return float(np.sqrt(np.mean(relative))) if relative else float("nan")
