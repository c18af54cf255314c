"""Many recordings of one drive, replayed by one compiled call: their block residuals.

A diagnosis asks for the residuals of a lab day about ten thousand times. Laid side by side in memory, the recordings of a day
are simulated and averaged without going back to the interpreter in between, whose lock would keep the other threads waiting.
The simulation is that of :func:`~identification.replay.output_error.simulate_run`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.compilation import kernel
from flexdrive_gym.drive.effects import N_PARAMETERS, WORKSPACE
from flexdrive_gym.drive.kernels import NOTHING, run_recording
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import FloatArray
from identification.replay.lanes import Interleaved, within
from identification.replay.output_error import PHYSICS_S, RUNAWAY, Run, drive_vector, held

# entries of a recording's row of whole numbers
_BEGIN, _SAMPLES, _PIECES, _BLOCK, _BLOCKS, _ROW, _FIRST_SAMPLE = range(7)

# Coulomb levels, which may be a run's own
_LEVELS = ("d1", "d2")


def _but_levels(values: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name not in _LEVELS}


@kernel
def _replay(
    first: int,
    last: int,
    places: Any,
    h: Any,
    substeps: Any,
    starts: Any,
    u: Any,
    track: Any,
    offsets: Any,
    measured: Any,
    keep: Any,
    carts: int,
    positions: bool,
    runaway: float,
    p: Any,
    memory: Any,
    z: Any,
    pushes: Any,
    nothing: Any,
    scratch: Any,
    moved: Any,
    out: Any,
) -> None:
    """Write block means of measured minus simulated for recordings ``first`` to ``last``; 0 where no sample is valid."""
    row = 0
    for r in range(first, last):
        begin, n, pieces = places[r, _BEGIN], places[r, _SAMPLES], places[r, _PIECES]
        block, blocks, sample = places[r, _BLOCK], places[r, _BLOCKS], places[r, _FIRST_SAMPLE]
        fine = n * pieces
        y = scratch[: 4 * fine].reshape(4, fine)
        way = track[2 * begin : 2 * (begin + fine)].reshape(2, fine)
        if offsets[r] != 0.0:
            shifted = moved[: 2 * fine].reshape(2, fine)
            for c in range(2):
                for i in range(fine):
                    shifted[c, i] = way[c, i] + offsets[r]
            way = shifted
        force = nothing
        if pushes.shape[0] > 0:
            at = 2 * (begin - places[first, _BEGIN])
            force = pushes[at : at + 2 * fine].reshape(2, fine)
        run_recording(
            u[begin : begin + fine], h[r], substeps[r], starts[r], memory, z, p[r - first], y, nothing, way, force
        )
        for c in range(carts):
            for b in range(blocks):
                total, count = 0.0, 0
                for i in range(b * block, min((b + 1) * block, n)):
                    if keep[carts * sample + c * n + i]:
                        if positions:
                            simulated = within(y[c, i * pieces], runaway)
                        elif pieces > 1 and i > 0:
                            moved_on = within(y[c, i * pieces], runaway) - within(y[c, (i - 1) * pieces], runaway)
                            simulated = moved_on / (h[r] * pieces)
                        else:
                            simulated = within(y[2 + c, i * pieces], runaway)
                        total += measured[carts * sample + c * n + i] - simulated
                        count += 1
                out[row] = total / max(count, 1)
                row += 1


class Together:
    """Prepared recordings side by side in memory; they do not change any more.

    Parameters
    ----------
    runs
        Prepared recordings, all of the same carts, and all of velocities or all of positions.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        self.runs = list(runs)
        self.carts, self.positions = len(self.runs[0].keep), self.runs[0].positions
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
            begin, sample, row = begin + len(u), sample + n, row + self.carts * blocks
        self._places, self._h, self._rows = np.array(places, dtype=np.int64), np.array(h), row
        self._u, self._track = np.concatenate(commands), np.concatenate(tracks)
        self._starts = np.array([run.start for run in self.runs])
        self._measured = np.concatenate([x for run in self.runs for x in run.measured])
        self._keep = np.concatenate([x for run in self.runs for x in run.keep])
        self._longest = int(max(len(u) for u in commands))
        self._held = bool((self._places[:, _PIECES] == 1).all())
        self._interleaved: dict[tuple[int, int], Interleaved] = {}

    def _fits(self, values: Mapping[str, float], pushes: Sequence[FloatArray] | None) -> bool:
        """Whether one drive can be replayed in lanes: it has a workspace, and commands that are held from sample to sample."""
        return self._held and (pushes is not None or parameters.needs_workspace(values))

    def _lanes(self, first: int, last: int) -> Interleaved:
        if (first, last) not in self._interleaved:
            self._interleaved[first, last] = Interleaved(self.runs[first:last])
        return self._interleaved[first, last]

    def tasks(
        self, values: Mapping[str, float], offsets: FloatArray, shares: Iterable[tuple[int, int]]
    ) -> tuple[FloatArray, list[Callable[[], object]]]:
        """Return where the residuals of one drive will be, and tasks that write them, which may run side by side.

        Where recordings do not go in lanes, ``shares`` are the first recording of each task and the first beyond.
        """
        out = np.empty(self._rows)
        if self._fits(values, None):
            lanes = self._lanes(0, len(self.runs))
            return out, [partial(lanes.residual, values, offsets, group=g, out=out) for g in range(len(lanes.groups))]
        rows = [*self._places[:, _ROW], self._rows]

        def write(first: int, last: int) -> None:
            out[rows[first] : rows[last]] = self.residual(values, offsets, first, last)

        return out, [partial(write, *share) for share in shares]

    def residual(
        self,
        values: Mapping[str, float] | Sequence[Mapping[str, float]],
        offsets: FloatArray,
        first: int = 0,
        last: int | None = None,
        pushes: Sequence[FloatArray] | None = None,
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

        Returns
        -------
        ndarray, shape (blocks of the recordings,)
            [mm/s] or [mm].
        """
        last = len(self.runs) if last is None else last
        asked = range(first, last)
        drives = [values] if isinstance(values, Mapping) else list(values)
        alike = all(_but_levels(v) == _but_levels(drives[0]) for v in drives[1:])
        if last - first > 1 and alike and self._fits(drives[0], pushes):
            common, levels = drives[0], None
            if len(drives) > 1:
                levels = np.array([[v.get(name, 0.0) for name in _LEVELS] for v in drives])
                common = {**common, **{name: 0.0 for name in _LEVELS if name in common}}
            return self._lanes(first, last).residual(common, offsets[first:last], pushes, levels)
        z = np.zeros(WORKSPACE) if pushes is not None or any(parameters.needs_workspace(v) for v in drives) else None
        if len(drives) == 1:
            drives = drives * len(asked)
        p, substeps = np.empty((len(asked), N_PARAMETERS)), np.empty(len(self.runs), dtype=np.int64)
        known: dict[tuple[int, float | None, float], tuple[FloatArray, int]] = {}
        for i, r in enumerate(asked):
            key = id(drives[i]), self.runs[r].cutoff, float(self._h[r])
            if key not in known:
                steps = parameters.substeps(drives[i], float(self._h[r]), PHYSICS_S)
                known[key] = drive_vector(drives[i], self.runs[r]), steps
            p[i], substeps[r] = known[key]
        force = np.zeros(0)
        if pushes is not None:
            pieces = self._places[first:last, _PIECES]
            force = np.concatenate(
                [(f if k == 1 else np.repeat(f, k, axis=1)).ravel() for f, k in zip(pushes, pieces, strict=True)]
            )
        rows = self._places[:, _ROW]
        out = np.empty((rows[last] if last < len(rows) else self._rows) - rows[first])
        _replay(
            first, last, self._places, self._h, substeps, self._starts, self._u, self._track, offsets, self._measured,
            self._keep, self.carts, self.positions, RUNAWAY, p, np.zeros(WORK_SPACE), z, force, NOTHING,
            np.empty(4 * self._longest), np.empty(2 * self._longest if offsets.any() else 0), out,
        )  # fmt: skip
        return out
