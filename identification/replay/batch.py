"""Many recordings of one drive, replayed by one compiled call: their block residuals.

A diagnosis asks for the residuals of a data set about ten thousand times. Laid side by side in memory, the recordings of a day
are simulated and averaged without going back to the interpreter in between, whose lock would keep the other threads waiting.
The simulation is that of :func:`~identification.replay.output_error.simulate_run`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.compilation import kernel
from flexdrive_gym.drive.effects import N_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.kernels import NOTHING, run_recording
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import BoolArray, FloatArray
from identification.replay.lanes import Across, LaneReplay, within
from identification.replay.output_error import PHYSICS_S, RUNAWAY, Run, drive_vector, held

# entries of a recording's row of whole numbers
_BEGIN, _SAMPLES, _PIECES, _BLOCK, _BLOCKS, _ROW, _FIRST_SAMPLE = range(7)

# Coulomb levels, which may be a run's own
_LEVELS = ("d1", "d2")


def _but_levels(values: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name not in _LEVELS}


class Recorded(NamedTuple):
    """Recordings side by side in memory.

    Attributes
    ----------
    places : ndarray of int, shape (recordings, 7)
        Where each recording is.
    h : ndarray, shape (recordings,)
        Sample times of the replay [s].
    starts : ndarray, shape (recordings, 4)
        x1, v1, x2, v2 at the first sample.
    u, track, measured, keep : ndarray
        Commands [V], where the carts were [mm], measured motion and whether it is valid.
    carts
        1 or 2.
    positions
        Whether positions were measured, or velocities.
    """

    places: npt.NDArray[np.int64]
    h: FloatArray
    starts: FloatArray
    u: FloatArray
    track: FloatArray
    measured: FloatArray
    keep: BoolArray
    carts: int
    positions: bool


class Asked(NamedTuple):
    """The drive that every recording is replayed by, and how: parameters, substeps, offsets of the track, additional forces."""

    p: FloatArray
    substeps: npt.NDArray[np.int64]
    offsets: FloatArray
    pushes: FloatArray


class Work(NamedTuple):
    """Memory and workspace of the step, readings of the longest recording, its track where it is moved."""

    memory: FloatArray
    z: FloatArray | None
    readings: FloatArray
    track: FloatArray


@kernel
def _replay(first: int, last: int, recorded: Recorded, asked: Asked, work: Work, nothing: Any, out: Any) -> None:
    """Write block means of measured minus simulated for recordings ``first`` to ``last``; 0 where no sample is valid."""
    places, h, carts, offsets, pushes = recorded.places, recorded.h, recorded.carts, asked.offsets, asked.pushes
    keep, measured = recorded.keep, recorded.measured
    row = 0
    for r in range(first, last):
        begin, n, pieces = places[r, _BEGIN], places[r, _SAMPLES], places[r, _PIECES]
        block, blocks, sample = places[r, _BLOCK], places[r, _BLOCKS], places[r, _FIRST_SAMPLE]
        fine = n * pieces
        y = work.readings[: 4 * fine].reshape(4, fine)
        way = recorded.track[2 * begin : 2 * (begin + fine)].reshape(2, fine)
        if offsets[r] != 0.0:
            shifted = work.track[: 2 * fine].reshape(2, fine)
            for c in range(2):
                for i in range(fine):
                    shifted[c, i] = way[c, i] + offsets[r]
            way = shifted
        force = nothing
        if pushes.shape[0] > 0:
            at = 2 * (begin - places[first, _BEGIN])
            force = pushes[at : at + 2 * fine].reshape(2, fine)
        u, start = recorded.u[begin : begin + fine], recorded.starts[r]
        run_recording(
            u, h[r], asked.substeps[r], start, work.memory, work.z, asked.p[r - first], y, nothing, way, force
        )
        for c in range(carts):
            for b in range(blocks):
                total, count = 0.0, 0
                for i in range(b * block, min((b + 1) * block, n)):
                    if keep[carts * sample + c * n + i]:
                        if recorded.positions:
                            simulated = within(y[c, i * pieces], RUNAWAY)
                        elif pieces > 1 and i > 0:
                            moved_on = within(y[c, i * pieces], RUNAWAY) - within(y[c, (i - 1) * pieces], RUNAWAY)
                            simulated = moved_on / (h[r] * pieces)
                        else:
                            simulated = within(y[2 + c, i * pieces], RUNAWAY)
                        total += measured[carts * sample + c * n + i] - simulated
                        count += 1
                out[row] = total / max(count, 1)
                row += 1


class RunBatch:
    """Prepared recordings side by side in memory; they do not change any more.

    Parameters
    ----------
    runs
        Prepared recordings, all of the same carts, and all of velocities or all of positions.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        self.runs = list(runs)
        carts = len(self.runs[0].keep)
        places, begin, sample, row = [], 0, 0, 0
        commands, tracks, h = [], [], []
        for run in self.runs:
            u, track, pieces = held(run)
            n = len(run.u)
            blocks = -(-n // run.block)
            places.append((begin, n, pieces, run.block, blocks, row, sample))
            commands.append(u)
            tracks.append(track.ravel())
            h.append(run.sample_time / pieces)
            begin, sample, row = begin + len(u), sample + n, row + carts * blocks
        self._rows = row
        self._recorded = Recorded(
            places=np.array(places, dtype=np.int64),
            h=np.array(h),
            starts=np.array([run.start for run in self.runs]),
            u=np.concatenate(commands),
            track=np.concatenate(tracks),
            measured=np.concatenate([x for run in self.runs for x in run.measured]),
            keep=np.concatenate([x for run in self.runs for x in run.keep]),
            carts=carts,
            positions=self.runs[0].positions,
        )
        self._longest = int(max(len(u) for u in commands))
        self._held = bool((self._recorded.places[:, _PIECES] == 1).all())
        self._lane_replays: dict[tuple[int, int], LaneReplay] = {}

    def _lanes(self, first: int, last: int) -> LaneReplay:
        if (first, last) not in self._lane_replays:
            self._lane_replays[first, last] = LaneReplay(self.runs[first:last])
        return self._lane_replays[first, last]

    def residual(
        self,
        values: Mapping[str, float] | Sequence[Mapping[str, float]],
        offsets: FloatArray,
        first: int = 0,
        last: int | None = None,
        pushes: Sequence[FloatArray] | None = None,
        across: Across | None = None,
    ) -> FloatArray:
        """Return block means of measured minus simulated motion, recording after recording, cart after cart.

        Parameters
        ----------
        values
            The drive, or one drive per recording.
        offsets : ndarray, shape (all recordings,)
            Added to where the carts were [mm].
        first, last
            Recordings asked for: ``first`` to ``last - 1``; default: all.
        pushes
            Additional forces on the carts [V], per recording asked for, ndarray, shape (2, n).
        across
            Maps over groups of recordings that go in lanes; default: all by one call.

        Returns
        -------
        ndarray, shape (blocks of the recordings,)
            [mm/s] or [mm].
        """
        last = len(self.runs) if last is None else last
        asked = range(first, last)
        drives = [values] if isinstance(values, Mapping) else list(values)
        alike = all(_but_levels(v) == _but_levels(drives[0]) for v in drives[1:])
        if last - first > 1 and alike and self._held:
            common, levels = drives[0], None
            if len(drives) > 1:
                levels = np.array([[v.get(name, 0.0) for name in _LEVELS] for v in drives])
                common = {**common, **{name: 0.0 for name in _LEVELS if name in common}}
            return self._lanes(first, last).residual(common, offsets[first:last], pushes, levels, across)
        z = np.zeros(WORKSPACE) if pushes is not None or any(parameters.needs_workspace(v) for v in drives) else None
        if len(drives) == 1:
            drives = drives * len(asked)
        p, substeps = np.empty((len(asked), N_PARAMETERS)), np.empty(len(self.runs), dtype=np.int64)
        known: dict[tuple[int, float | None, float], tuple[FloatArray, int]] = {}
        for i, r in enumerate(asked):
            key = id(drives[i]), self.runs[r].cutoff, float(self._recorded.h[r])
            if key not in known:
                steps = parameters.substeps(drives[i], float(self._recorded.h[r]), PHYSICS_S)
                known[key] = drive_vector(drives[i], self.runs[r]), steps
            p[i], substeps[r] = known[key]
        force = np.zeros(0)
        if pushes is not None:
            pieces = self._recorded.places[first:last, _PIECES]
            force = np.concatenate(
                [(f if k == 1 else np.repeat(f, k, axis=1)).ravel() for f, k in zip(pushes, pieces, strict=True)]
            )
        rows = self._recorded.places[:, _ROW]
        out = np.empty((rows[last] if last < len(rows) else self._rows) - rows[first])
        work = Work(
            np.zeros(WORK_SPACE), z, np.empty(4 * self._longest), np.empty(2 * self._longest if offsets.any() else 0)
        )
        _replay(first, last, self._recorded, Asked(p, substeps, offsets, force), work, NOTHING, out)
        return out
