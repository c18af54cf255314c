r"""Proof: before and after on recordings that no fit has seen.

Both models are fitted to the recordings learnt from, without any freedom from run to run. Where an effect repeats along the
track, the place where a new run began is unknown and is found in that run: one number a run, for the position alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.recording import FloatArray, Recording
from identification.floor import measure_floor
from identification.mismatch.crew import Crew
from identification.mismatch.refit import refit
from identification.mismatch.settle import absorb
from identification.mismatch.surroundings import rubbed
from identification.mismatch.verdict import RecordingFit
from identification.mismatch.workbench import View, Workbench
from identification.replay.output_error import Run, prepare, simulate_run
from identification.validation import simulate_like

_PLACES = 24
# a run's own friction is sought in steps of so many standard deviations
_WIDTHS = (1.5, 1.0, 0.5)
# share of the squared error that a fit's last step may still remove, before and after its weights are set
_NEAR, _SHARP = 2e-3, 1e-4


def polished(bench: Workbench, values: Mapping[str, float], names: Sequence[str]) -> Mapping[str, float]:
    """Return the model fitted with one friction for all runs: what a drive file can hold."""
    bench.forget_random_effects()
    # weights are those of the drive's own errors: they are not worth a sharp fit before it is near
    for rough, tolerance in ((True, _NEAR), (False, _SHARP)):
        bench.weigh(bench.residual(values))
        values = refit(bench, values, names, iterations=5, rough=rough, tolerance=tolerance).values
    return values


def period_of(values: Mapping[str, float]) -> float:
    """Return the shortest spatial period among the effects that are present [mm]; 0 where nothing repeats."""
    found = [
        v
        for k, v in values.items()
        if k.endswith(".P") and any(values.get(k[:-1] + a, 0.0) for a in ("a_sin", "a_cos"))
    ]
    return min(found, default=0.0)


def place(values: Mapping[str, float], recordings: Sequence[Recording], pool: Crew) -> FloatArray:
    """Return where every run began along the track [mm], as far as a repeating effect tells."""
    period = period_of(values)
    # parts of one recording keep its clock, and its place along the track
    if not period or not recordings or any(r.t[0] > 0.0 for r in recordings):
        return np.zeros(len(recordings))
    bench = Workbench([prepare(r) for r in recordings], pool)
    costs = []
    tried = period * np.arange(_PLACES) / _PLACES
    for offset in tried:
        bench.offsets = np.full(len(recordings), offset)
        e = bench.residual(values) * bench.rows.valid
        costs.append([float(np.sum(e[bench.rows.of(r)] ** 2)) for r in range(len(recordings))])
    return np.asarray(tried[np.argmin(np.array(costs), axis=0)])


def velocity_fits(
    before: Mapping[str, float],
    after: Mapping[str, float],
    recordings: Sequence[Recording],
    everything: Sequence[Recording],
    pool: Crew,
    *,
    held_out: bool,
) -> list[RecordingFit]:
    """Return rms residuals of open-loop recordings before and after, sample by sample [mm/s].

    Parameters
    ----------
    everything
        All recordings, whose replicates tell the floor.
    """
    floors: dict[str, list[float]] = {}
    for f in measure_floor(everything):
        floors.setdefault(f.recording, []).append(f.rms)
    places = place(after, recordings, pool)

    def one(item: tuple[Recording, float]) -> RecordingFit:
        recording, offset = item
        run = prepare(recording)
        run.track[:] += offset
        rms = [_rms(values, run) for values in (before, after)]
        own = [f for f in floors.get(recording.name, []) if np.isfinite(f)]
        floor = float(np.sqrt(np.mean(np.square(own)))) if own else float("nan")
        return RecordingFit(recording.name, rms[0], rms[1], floor, held_out)

    return list(pool.map(one, zip(recordings, places, strict=True)))


def _rms(values: Mapping[str, float], run: Run) -> float:
    simulation = simulate_run(values, run)
    errors = [(m - s)[k] for m, s, k in zip(run.measured, simulation, run.keep, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def removed_from(
    recordings: Sequence[Recording],
    without: Mapping[str, float],
    everything: Mapping[str, float],
    pool: Crew,
    *,
    parts: bool,
    view: View,
    spread: float,
) -> float:
    """Return the share of another drive's squared error in a view that a drive removes in recordings.

    Rough track and friction that differs from run to run are in both errors, often larger than what is to be proven. Among
    comparable residuals they hardly count; but a cart that rests in one run and moves in the next is no small change, so each
    drive meets every run with that run's own dry friction (:func:`own_friction`).
    """
    bench = placed(recordings, everything, pool, parts=parts)
    absorb(bench, without)
    before, after = (float(np.sum(bench.seen(view, _own(bench, v, spread)) ** 2)) for v in (without, everything))
    return 1.0 - after / before


def plain_ratio(
    recordings: Sequence[Recording],
    without: Mapping[str, float],
    everything: Mapping[str, float],
    pool: Crew,
    *,
    parts: bool,
    spread: float,
) -> float:
    """Return the ratio of plain rms, after over before, each run with its own dry friction as in :func:`removed_from`."""
    bench = placed(recordings, everything, pool, parts=parts)
    bench.weigh(bench.residual(without))
    both = (np.sum((_own(bench, v, spread) * bench.rows.valid) ** 2) for v in (without, everything))
    before, after = (float(np.sqrt(square)) for square in both)
    return after / before


def placed(recordings: Sequence[Recording], values: Mapping[str, float], pool: Crew, *, parts: bool) -> Workbench:
    """Return the workbench of recordings, each where along the track a drive says that it began."""
    bench = Workbench([prepare(r) for r in recordings], pool, parts=parts)
    bench.offsets = place(values, recordings, pool)
    return bench


def own_rms(
    before: Mapping[str, float],
    after: Mapping[str, float],
    recordings: Sequence[Recording],
    pool: Crew,
    spread: float,
) -> tuple[float, float]:
    """Return the rms of recordings before and after, sample by sample [mm/s], each run with its own dry friction."""
    bench = Workbench([prepare(r) for r in recordings], pool)
    bench.offsets = place(after, recordings, pool)
    bench.weigh(bench.residual(before))
    drives = [own_friction(bench, values, spread) for values in (before, after)]
    for run, offset in zip(bench.runs, bench.offsets, strict=True):
        run.track[:] += offset
    low, high = (
        float(np.sqrt(np.mean([_rms(values, run) ** 2 for values, run in zip(own, bench.runs, strict=True)])))
        for own in drives
    )
    return low, high


def _own(bench: Workbench, values: Mapping[str, float], spread: float) -> FloatArray:
    if not spread:
        return bench.residual(values)
    return bench.residual(own_friction(bench, values, spread))


def own_friction(bench: Workbench, values: Mapping[str, float], spread: float) -> list[dict[str, float]]:
    """Return, for every run, the drive with the dry friction that suits the run best.

    Friction of each cart changes by a factor, whose logarithm has a normal prior with standard deviation ``spread``. One number
    per run and cart is no physics: it is what differs between two runs of the same rig.
    """
    carts = range(len(bench.runs[0].keep))

    def met(steps: Sequence[float]) -> dict[str, float]:
        return rubbed(values, [float(np.exp(step * spread)) for step in steps])

    def one(r: int) -> dict[str, float]:
        weights = bench.weights[bench.rows.of(r)]

        def cost(steps: Sequence[float]) -> float:
            e = weights * bench.blocks(met(steps), r)
            return float(e @ e + np.sum(np.square(steps)))

        steps = [0.0] * len(carts)
        best = cost(steps)
        for width in _WIDTHS:
            for c in carts:
                for way in (-width, width):
                    other = [s + way * (i == c) for i, s in enumerate(steps)]
                    found = cost(other)
                    if found < best:
                        best, steps = found, other
        return met(steps)

    return list(bench.pool.map(one, range(len(bench.runs))))


def loop_fits(before: Drive, after: Drive, recordings: Sequence[Recording]) -> list[RecordingFit]:
    """Return rms residuals of closed-loop recordings, simulated in the loop: positions [mm]."""
    fits = []
    for r in recordings:
        if r.xr is None or r.excitation.gain is None:
            continue
        rms = [_position_rms(r, simulate_like(drive, r)) for drive in (before, after)]
        fits.append(RecordingFit(r.name, rms[0], rms[1], float("nan"), held_out=True, unit="mm"))
    return fits


def _position_rms(measured: Recording, simulated: Recording) -> float:
    squares = []
    for name in ("x1", "x2"):
        y, s = getattr(measured, name), getattr(simulated, name)
        if y is not None and s is not None:
            squares.append((y - s)[measured.valid(name)] ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else float("nan")


def total(fits: Sequence[RecordingFit], *, held_out: bool | None = None) -> tuple[float, float, float]:
    """Return rms before, after and floor over recordings of velocities; nan where there are none."""
    chosen = [f for f in fits if f.unit == "mm/s" and (held_out is None or f.held_out == held_out)]
    if not chosen:
        return float("nan"), float("nan"), float("nan")
    floors = [f.floor_rms for f in chosen if np.isfinite(f.floor_rms)]
    rms = [float(np.sqrt(np.mean([getattr(f, n) ** 2 for f in chosen]))) for n in ("before_rms", "after_rms")]
    return rms[0], rms[1], float(np.sqrt(np.mean(np.square(floors)))) if floors else float("nan")
