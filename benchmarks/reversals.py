"""Does the track give way? The mean of all reversals of the command, measured and simulated with and without ``base_recoil``.

``python -m benchmarks reversals`` fits the free drive, then with base_recoil, then with play of the motor or a delay besides,
each run with its own friction, to the recordings in ``../shared/recordings``; prints by how much v1 and v2 jump within 10 ms of
a reversal and what is left of the sines of 12 and 16 Hz; and writes a picture of each rig to ``benchmarks/out``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.per_run import PerRun, fit_per_run, simulate
from flexdrive_gym import Recording
from identification import identify, read_recordings
from identification.likelihood import usable
from identification.plots.reversals import plot_reversals
from identification.plots.style import save_png
from identification.replay.output_error import Run, prepare
from identification.reversals import Reversal, mean_reversal

DATA = Path(__file__).parents[2] / "shared" / "recordings"
OUT = Path(__file__).parent / "out"
RIGS = ("mte360_2022", "mte360_2025")
# where quick fits to the mean reversals of 2022 ended
_RECOIL = {"base_recoil.compliance": 0.035, "base_recoil.frequency": 34.0, "base_recoil.zeta": 0.5}
_DELAY = {"input_delay.tau": 2e-3}
_PLAY = {"motor_gear_backlash.mass": 3e-5, "motor_gear_backlash.gap": 0.1, "motor_gear_backlash.kc": 15.0}
_SINES_HZ = (12.0, 16.0)


def main() -> None:
    for rig in RIGS:
        if (DATA / rig).is_dir():
            study(rig)
        else:
            print(f"skipped: no recordings in ../shared/recordings/{rig}")


def study(rig: str) -> None:
    recordings = read_recordings(DATA / rig)
    used, _notes = usable(recordings)
    runs = [prepare(r) for r in used]
    free = fit_per_run(runs, identify(recordings).drive.values)
    recoil = fit_per_run(runs, {**free.values, **_RECOIL}, list(_RECOIL), free.own)
    both = fit_per_run(runs, {**recoil.values, **_PLAY}, [*_RECOIL, *_PLAY], recoil.own, 8)
    delayed = fit_per_run(runs, {**recoil.values, **_DELAY}, [*_RECOIL, *_DELAY], recoil.own, 8)
    models = {
        "free drive": free,
        "+ base_recoil": recoil,
        "+ base_recoil + motor_gear_backlash": both,
        "+ base_recoil + input_delay": delayed,
    }
    groups = _grouped(used)
    measured = {title: [r for i in rows if (r := mean_reversal(used[i]))] for title, rows in groups.items()}
    simulated = {name: _simulated(fit, used, runs, groups) for name, fit in models.items()}
    print(f"{rig}: jump of v1, v2 within 10 ms of a reversal [mm/s]")
    for title, found in measured.items():
        print(f"  {title:10s} measured ({sum(r.count for r in found)} reversals): {_jumps(found)}")
        for name, by_title in simulated.items():
            print(f"  {'':10s} {name}: {_jumps(by_title[title])}")
    for name, fit in models.items():
        sines = ", ".join(f"{f:g} Hz {fit.rms[i]:.2f}" for f in _SINES_HZ for i in _sine(used, f))
        added = ", ".join(f"{k} = {v:.3g}" for k, v in fit.values.items() if "." in k and "quantum" not in k)
        print(f"  {name}: rms {fit.total:.2f} mm/s over all runs, {sines}; {added}")
    figure = plot_reversals(measured, simulated)
    OUT.mkdir(exist_ok=True)
    print(f"wrote {save_png(figure, OUT / f'reversals_{rig}.png', 120)}")


def _grouped(recordings: Sequence[Recording]) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for i, r in enumerate(recordings):
        if r.excitation.kind == "square" and mean_reversal(r) is not None:
            groups.setdefault(f"±{r.excitation.amplitude:.3g} V", []).append(i)
    return dict(sorted(groups.items()))


def _simulated(
    fit: PerRun, recordings: Sequence[Recording], runs: Sequence[Run], groups: dict[str, list[int]]
) -> dict[str, list[Reversal]]:
    return {
        title: [r for i in rows if (r := mean_reversal(recordings[i], simulate(fit.values, runs[i], fit.own[i])))]
        for title, rows in groups.items()
    }


def _jumps(found: Sequence[Reversal]) -> str:
    return ", ".join(f"{x:.1f}" for x in np.mean([r.jumps() for r in found], axis=0))


def _sine(recordings: Sequence[Recording], frequency: float) -> list[int]:
    return [
        i
        for i, r in enumerate(recordings)
        if r.excitation.kind == "sine" and r.excitation.frequency and abs(r.excitation.frequency - frequency) < 0.1
    ]
