"""How strong is "plainly present"? ``python -m baselines.rig_simulator.calibrate`` measures it and rewrites ``sizes.py``.

An effect is simulated with and without on three drives, otherwise alike and without nuisance. Two figures are taken, both
over the third of the velocity channels in which it acts most: the rms change of velocity, and what of it is left after the seven
parameters of the baseline are refitted (linearised). Strength 1 is set so that two floors are left, but the change itself lies
between 1.5 and 4 floors: an effect that the refit swallows stays as hard to see as it is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from baselines.rig_simulator.catalogue import CATALOGUE, OUTSIDE, Maker
from baselines.rig_simulator.kernel import SAMPLE_S, FloatArray
from baselines.rig_simulator.nuisance import Nuisance
from baselines.rig_simulator.recordings import put, simulate_data_set
from baselines.rig_simulator.sizes import SIZES
from baselines.rig_simulator.truth import Effect, Truth, draw_drive

# what does not repeat on the quieter recorded rig [mm/s]
FLOOR_MM_S = 2.9
AIM, LEAST, MOST = 2.0, 1.5, 4.0
SEEDS = (11, 12, 13)
# a static level of three times the kinetic one, a hump as high as the level: more is no contact anybody builds;
# 5 ms of delay, 4 % of scale: more is a wrong data sheet
PLAUSIBLE = {"breakaway": 4.0, "stribeck": 3.0, "encoder_delay": 1.3, "encoder_scale": 1.0}
_STEP = 0.02
_ROUNDS = 4


@dataclass(frozen=True)
class Calibration:
    """A strength, and in floors the change it makes and what a refit of the baseline leaves of it."""

    name: str
    strength: float
    change: float
    left: float


def _channels(truth: Truth) -> list[FloatArray]:
    """Return v1 and v2 as shown, not counted, of every open-loop run."""
    shown = (log.shown for log in simulate_data_set(truth) if log.xr is None)
    return [np.diff(row) / SAMPLE_S for pair in shown for row in pair]


@cache
def _quiet_data_set(seed: int) -> tuple[Truth, list[FloatArray], FloatArray]:
    """Return a quiet data set, its velocities, and an orthonormal basis of what seven parameters can do, shape (N, 7)."""
    drive = draw_drive(np.random.default_rng(seed))
    truth = Truth("null", seed, drive, (), Nuisance(place=25.0))
    here = _channels(truth)
    base = np.concatenate(here)
    columns = []
    for name, value in drive.items():
        changed = replace(truth, drive={**drive, name: value * (1.0 + _STEP)})
        columns.append(np.concatenate(_channels(changed)) - base)
    basis, _ = np.linalg.qr(np.column_stack(columns))
    return truth, here, basis


def _acting(parts: Sequence[FloatArray]) -> float:
    """Return the rms over the third of the channels with the most."""
    squares = sorted(float(np.mean(part**2)) for part in parts)
    return float(np.sqrt(np.mean(squares[-len(squares) // 3 :])))


def measure(maker: Maker, strength: float) -> tuple[float, float]:
    """Return the change and what a refit leaves of it, in floors, rms over the data sets."""
    change, left = [], []
    for seed in SEEDS:
        truth, here, basis = _quiet_data_set(seed)
        # one stream per maker and data set: its periods and signs stay while its strength is sought
        numbers = maker.make(np.random.default_rng([seed, 1]), truth.drive, strength)
        concealed = replace(truth, effects=(Effect(maker.id, maker.where, numbers, 1.0),))
        parts = [there - was for there, was in zip(_channels(concealed), here, strict=True)]
        whole = np.concatenate(parts)
        rest = np.split(whole - basis @ (basis.T @ whole), np.cumsum([len(p) for p in parts])[:-1])
        change.append(_acting(parts))
        left.append(_acting(rest))
    return float(np.sqrt(np.mean(np.square(change)))) / FLOOR_MM_S, float(
        np.sqrt(np.mean(np.square(left)))
    ) / FLOOR_MM_S


def calibrate(name: str) -> Calibration:
    """Find the strength of an effect, named ``id@where``, that is plainly present."""
    maker = next(m for m in (*CATALOGUE, *OUTSIDE) if f"{m.id}@{m.where}" == name)
    strength = 1.0
    change, left = measure(maker, strength)
    for _ in range(_ROUNDS):
        if change <= 0.0:
            break
        factor = float(np.clip(AIM / left, LEAST / change, MOST / change))
        if abs(np.log(factor)) < 0.07:
            break
        # damped, because some effects grow faster than their strength
        strength = min(strength * float(np.clip(factor**0.85, 0.2, 5.0)), PLAUSIBLE.get(maker.id, np.inf))
        change, left = measure(maker, strength)
    return Calibration(name, float(f"{strength:.3g}"), change, left)


def main(arguments: Sequence[str] | None = None) -> int:
    """Calibrate everything (or what is named), print the table, write ``sizes.py``."""
    parser = argparse.ArgumentParser(prog="python -m baselines.rig_simulator.calibrate", description=__doc__)
    parser.add_argument("names", nargs="*", help="id@where; everything if none")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    names = given.names or [f"{m.id}@{m.where}" for m in (*CATALOGUE, *OUTSIDE) if m.id != "rectified_sensor"]
    with ProcessPoolExecutor(given.jobs) as pool:
        rows = []
        for row in pool.map(calibrate, names):
            rows.append(row)
            print(f"{row.name:42s} strength {row.strength:<8.3g} change {row.change:5.2f} floors, left {row.left:5.2f}")
            sys.stdout.flush()
    table = dict(SIZES) | {row.name: (row.strength, round(row.change, 2), round(row.left, 2)) for row in rows}
    put(Path(__file__).with_name("sizes.py"), _module(table).encode())
    return 0


def _module(table: Mapping[str, tuple[float, float, float]]) -> str:
    lines = [
        '"""Strengths that are plainly present; made by ``python -m baselines.rig_simulator.calibrate``.',
        "",
        "Per effect and place: strength, rms change of velocity, and what a refit of the baseline leaves of that change; the",
        f"latter two in floors of {FLOOR_MM_S} mm/s, over the third of the velocity channels in which the effect acts most.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from collections.abc import Mapping",
        "",
        "SIZES: Mapping[str, tuple[float, float, float]] = {",
        *(f'    "{name}": ({s:g}, {change:g}, {left:g}),' for name, (s, change, left) in sorted(table.items())),
        "}",
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    raise SystemExit(main())
