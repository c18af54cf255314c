"""Does each run have friction of its own, or does it follow the experiment? What follows the experiment is physics, not nuisance.

``python -m benchmarks friction_by_run`` fits the sines and squares of a rig with factors on d1 and d2 that are each run's own,
adds every effect of the catalogue in turn, then to the best of them the next, and prints how the factors depend on frequency:
the slope of log factor against log frequency, and by how much the factors differ. Two rows of simulations give the null
distribution: the fitted drive's own runs with all factors 1, read through the encoders' counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.per_run import OWN, PerRun, fit_per_run
from flexdrive_gym import Recording
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.recording import FloatArray
from identification import identify, read_recordings
from identification.likelihood import usable
from identification.replay.output_error import Run, prepare, simulate_run

DATA = Path(__file__).parents[2] / "shared" / "recordings"
# above it cart 2 hardly moves, and friction that is not overcome says nothing
_HIGHEST_HZ = 8.5
_NOT_ASKED = {
    "spring",
    "coulomb_friction",
    "viscous_friction",
    "encoder_quantisation",
    "velocity_processing",
    "rectified_sensor",
}
_GROUND = {"ground_spring.kg": 7e-4, "ground_spring.kg_2": 2e-3}
_RECOIL = {"base_recoil.compliance": 0.03, "base_recoil.frequency": 34.0, "base_recoil.zeta": 0.4}
# candidates of the later steps, how many effects at most, and what a further one must gain of the rms
_SHORT_LIST, _MOST, _LEAST_GAIN = 8, 4, 0.02


@dataclass(frozen=True)
class Trend:
    """Slope of log factor against log frequency with its standard error, and the spread of the log factors of the sines."""

    slope: float
    error: float
    spread: float

    def __str__(self) -> str:
        return f"{self.slope:+.2f} ± {self.error:.2f}, {self.spread:.2f}"


def frequencies(recordings: Sequence[Recording]) -> FloatArray:
    """Return the frequency of every sine [Hz]; nan for other runs and where cart 2 hardly moves."""
    found = [
        r.excitation.frequency if r.excitation.kind == "sine" and r.excitation.frequency else np.nan for r in recordings
    ]
    return np.where(np.array(found) <= _HIGHEST_HZ, found, np.nan)


def trend(fit: PerRun, frequency: FloatArray, cart: int) -> Trend:
    """Return how the factor of a cart's dry friction depends on the frequency of the sines."""
    sines = np.isfinite(frequency)
    x, y = np.log(frequency[sines]), fit.own[sines, cart - 1]
    a = np.column_stack([np.ones_like(x), x])
    solution = np.linalg.lstsq(a, y)[0]
    left = y - a @ solution
    error = np.sqrt(float(left @ left) / (len(y) - 2) * np.linalg.inv(a.T @ a)[1, 1])
    return Trend(float(solution[1]), float(error), float(np.std(y, ddof=1)))


def _additions() -> dict[str, list[dict[str, float]]]:
    """Return every effect with one or two sets of start values."""
    found = {}
    for effect in EFFECTS:
        if effect.id in _NOT_ASKED:
            continue
        for where in effect.where:
            sets = [{effect.key(where, q.name): q.starts[i] for q in effect.parameters} for i in (0, -1)]
            found[f"{effect.id} {where}" if len(effect.where) > 1 else effect.id] = sets[: 1 + (sets[0] != sets[1])]
    found["base_recoil"], found["ground_spring"] = [_RECOIL], [_GROUND]
    return found


def _row(label: str, fit: PerRun, frequency: FloatArray) -> str:
    return f"| {label} | {fit.total:.2f} | {trend(fit, frequency, 1)} | {trend(fit, frequency, 2)} |"


def _self_made(runs: Sequence[Run], values: Mapping[str, float], seed: int) -> list[Run]:
    """Return what the fitted drive would have recorded, read in whole counts from a random phase."""
    rng, made = np.random.default_rng(seed), []
    for run in runs:
        measured = []
        for v, quantum in zip(simulate_run(values, run), run.counts, strict=True):
            x = np.cumsum(v) * run.sample_time + quantum * rng.random()
            measured.append(np.diff(np.round(x / quantum) * quantum, prepend=0.0) / run.sample_time)
            measured[-1][0] = 0.0
        made.append(replace(run, measured=measured))
    return made


def main(rig: str = "mte360_2022") -> None:
    if not (DATA / rig).is_dir():
        print(f"skipped: no recordings in ../shared/recordings/{rig}")
        return
    recordings = read_recordings(DATA / rig)
    used, _notes = usable(recordings)
    runs, frequency = [prepare(r) for r in used], frequencies(used)
    base = fit_per_run(runs, identify(recordings).drive.values)
    print("| added to the free drive | rms [mm/s] | d1: slope, spread | d2: slope, spread |\n|---|---|---|---|")
    print(_row("nothing", base, frequency))
    for seed in (1, 2):
        made = fit_per_run(_self_made(runs, base.values, seed), base.values)
        print(_row(f"nothing; simulated, all factors 1 ({seed})", made, frequency), flush=True)
    labels, best = _forward(runs, base, frequency)
    print(f"\nfactors of d1, d2, constant force [V], preload [mm]; bare and with {' + '.join(labels)}:")
    for i, run in enumerate(runs):
        plain, named = (
            ", ".join(f"{x:.2f}" for x in (*np.exp(fit.own[i, :2]), *fit.own[i, 2:OWN])) for fit in (base, best)
        )
        print(f"{run.name:24s} {plain:28s} {named:28s} {base.rms[i]:.2f} -> {best.rms[i]:.2f} mm/s")
    print("parameters:", ", ".join(f"{k} = {v:.3g}" for k, v in best.values.items()))


def _forward(runs: Sequence[Run], base: PerRun, frequency: FloatArray) -> tuple[list[str], PerRun]:
    """Add the effect that leaves least, then the next, until one gains next to nothing."""
    additions = _additions()
    labels: list[str] = []
    best, asked = base, list(additions)
    while asked and len(labels) < _MOST:
        fits = {}
        for label in asked:
            free = [key for other in (*labels, label) for key in additions[other][0]]
            tried = [fit_per_run(runs, {**best.values, **starts}, free, best.own, 8) for starts in additions[label]]
            fits[label] = min(tried, key=lambda fit: fit.total)
            print(_row(" + ".join([*labels, label]), fits[label], frequency), flush=True)
        order = sorted(fits, key=lambda label: fits[label].total)
        if fits[order[0]].total > (1.0 - _LEAST_GAIN) * best.total:
            break
        labels, best = [*labels, order[0]], fits[order[0]]
        asked = order[1 : 1 + _SHORT_LIST]
        # what the rig's reversals show is asked in any case
        asked += [label for label in ("base_recoil",) if label not in (*asked, *labels)]
    return labels, best
