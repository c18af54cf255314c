"""How far drives are off in recordings, before and after physics was named: velocities in open loop, positions in closed.

Open-loop runs are replayed; effects of position follow the simulated carts. Closed loops are simulated in the loop where their
law is known, over short windows where it is not (:mod:`identification.validation`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import FloatArray
from identification.floor import measure_floor
from identification.mismatch.answer.verdict import Part, RecordingFit
from identification.mismatch.fitting.bench import Values, free
from identification.replay.output_error import Run, prepare, simulate_run
from identification.validation import validate


def recording_fits(
    before: Drive,
    after: Drive,
    recordings: Sequence[Recording],
    part: Part,
    everything: Sequence[Recording],
    pool: Executor,
) -> list[RecordingFit]:
    """Return the errors of two drives in open-loop recordings.

    Parameters
    ----------
    everything
        Recordings whose replicates tell the floor.
    """
    floors: dict[str, list[float]] = {}
    for f in measure_floor(everything):
        if np.isfinite(f.rms):
            floors.setdefault(f.recording, []).append(f.rms)

    def one(recording: Recording) -> RecordingFit:
        run = free(prepare(recording))
        speeds = [rms(_errors(run, d.values)) for d in (before, after)]
        places = [_position_rms(recording, run, d.values) for d in (before, after)]
        floor = rms(floors[recording.name]) if recording.name in floors else float("nan")
        return RecordingFit(
            recording.name,
            part,
            speeds[0],
            speeds[1],
            floor,
            before_position_rms=places[0],
            after_position_rms=places[1],
        )

    return list(pool.map(one, recordings))


def loop_fits(before: Drive, after: Drive, recordings: Sequence[Recording], pool: Executor) -> list[RecordingFit]:
    """Return the errors of two drives in closed-loop recordings: positions [mm], or velocities where none were recorded."""

    def one(recording: Recording) -> RecordingFit:
        (old,), (new,) = (validate(d, [recording]).overlays for d in (before, after))
        places = any(f.channel.startswith("x") for f in old.fits)
        each = [[f.rms for f in o.fits if f.channel.startswith("x") or not places] for o in (old, new)]
        return RecordingFit(
            recording.name, "report", rms(each[0]), rms(each[1]), unit="mm" if places else "mm/s", how=old.how
        )

    return list(pool.map(one, recordings))


def velocity_rms(recordings: Sequence[Recording], values: Values, pool: Executor) -> float:
    """Return the rms error of a drive's velocities over open-loop recordings [mm/s]; nan where there are none."""
    each = list(pool.map(partial(_of, values), recordings))
    return rms(each)


def total(fits: Iterable[RecordingFit]) -> tuple[float, float, float]:
    """Return rms before, after and floor over replayed velocities [mm/s]; nan where there are none."""
    chosen = [f for f in fits if f.how == "replay"]
    floors = [f.floor_rms for f in chosen if np.isfinite(f.floor_rms)]
    return rms([f.before_rms for f in chosen]), rms([f.after_rms for f in chosen]), rms(floors)


def rms(values: FloatArray | Sequence[float]) -> float:
    """Return the root mean square; nan of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


def _of(values: Values, recording: Recording) -> float:
    return rms(_errors(free(prepare(recording)), values))


def _errors(run: Run, values: Values) -> FloatArray:
    simulated = simulate_run(values, run)
    return np.concatenate([(m - s)[k] for m, s, k in zip(run.measured, simulated, run.keep, strict=True)])


def _position_rms(recording: Recording, run: Run, values: Values) -> float | None:
    places = [x for x in (recording.x1, recording.x2) if x is not None]
    if len(places) != len(run.measured):
        return None
    # encoders start anywhere
    moved = replace(run, measured=[x - x[0] for x in places], positions=True)
    simulated = simulate_run(values, moved)
    error = [(x - s + s[0])[k] for x, s, k in zip(moved.measured, simulated, run.keep, strict=True)]
    return rms(np.concatenate(error))
