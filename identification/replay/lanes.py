"""Recordings of one drive in the lanes of packs, replayed by one compiled call: their block residuals.

Recordings are taken in groups of as many as a :mod:`pack <flexdrive_gym.drive.simd.pack>` has lanes, of like length, and
everything measured is laid out lane beside lane. Simulated and averaged are all lanes of a group together. A group whose
lanes are not all taken repeats its first recording, and what is over waits until the group is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, kernel, pointer, shifted
from flexdrive_gym.drive.effects import LEVEL_1, LEVEL_2, N_PARAMETERS
from flexdrive_gym.drive.parameters import substeps
from flexdrive_gym.drive.sample import MEMORY, advance, anchor, measure, power_up, push
from flexdrive_gym.drive.simd.pack import WIDTH, chosen, lane, packs_at, spread, with_lane
from flexdrive_gym.drive.simd.step import MEMORIES, WORKSPACES, begin_lanes, step_lanes
from flexdrive_gym.recording import FloatArray
from identification.replay.output_error import PHYSICS_S, RUNAWAY, Run, drive_vector

# entries of a group's row of whole numbers, of which there is one for every lane after them: the first row of the result, how
# many blocks, where its pushes begin
_BEGIN, _SAMPLES, _BLOCK, _SUBSTEPS, _PARAMETERS, _LANES = range(6)
_ROW, _BLOCKS, _PUSHES, _LENGTH = (_LANES + i * WIDTH for i in range(4))
_ENTRIES = _LANES + 4 * WIDTH
# packs of one sample: command, track of both carts, of each cart what was measured and whether it is valid
_PER_SAMPLE = 7
# a map over parts of the work that do not depend on each other
Across = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]


@inlined
def within(x: Any, most: float) -> Any:
    """Return what is not a number, or farther from zero than ``most``, as ``most``."""
    # no comparison holds for nan
    return chosen(abs(x) < most, x, chosen(x <= -most, -most, most))


@inlined
def _of_lanes(x: Any, first: Any, step: int, i: int) -> Any:
    y = spread(0.0)
    for j in range(WIDTH):
        y = with_lane(y, j, x[first[_PUSHES + j] + step * first[_LENGTH + j] + min(i, first[_LENGTH + j] - 1)])
    return y


@kernel
def replay_lanes(
    groups: Any,
    h: Any,
    lanes: Any,
    starts: Any,
    offsets: Any,
    carts: int,
    positions: bool,
    runaway: float,
    p: Any,
    memory: Any,
    z: Any,
    pushes: Any,
    levels: Any,
    out: Any,
) -> None:
    """Write block means of measured minus simulated for all groups; 0 where no sample is valid."""
    m, w = packs_at(pointer(memory)), packs_at(pointer(z))
    table = shifted(pointer(memory), WIDTH * MEMORY)
    rows, where, begin, way = pointer(groups), pointer(lanes), pointer(starts), pointer(offsets)
    for g in range(groups.shape[0]):
        group = shifted(rows, g * _ENTRIES)
        n, block, substeps = group[_SAMPLES], group[_BLOCK], group[_SUBSTEPS]
        q = shifted(pointer(p), group[_PARAMETERS])
        told, start = packs_at(shifted(where, group[_BEGIN])), packs_at(shifted(begin, 4 * g * WIDTH))
        offset = packs_at(shifted(way, g * WIDTH))[0]
        x1, v1, x2, v2 = start[0], start[1], start[2], start[3]
        begin_lanes(v1, v2, h[g], substeps, table, m, w, q)
        if levels.shape[0] > 0:
            own = packs_at(shifted(pointer(levels), 2 * g * WIDTH))
            w[LEVEL_1], w[LEVEL_2] = own[0], own[1]
        anchor(told[1] + offset, told[2] + offset, x1, x2, w)
        r1, r2, s1, s2 = power_up(x1, v1, x2, v2, h[g], m, w, q)
        total_1, total_2, count_1, count_2 = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        b, left = 0, block
        for i in range(n):
            k = _PER_SAMPLE * i
            y1, y2 = (r1, r2) if positions else (s1, s2)
            valid_1, valid_2 = told[k + 4], told[k + 6]
            total_1 = chosen(valid_1 > 0.0, total_1 + (told[k + 3] - within(y1, runaway)), total_1)
            total_2 = chosen(valid_2 > 0.0, total_2 + (told[k + 5] - within(y2, runaway)), total_2)
            count_1, count_2 = count_1 + valid_1, count_2 + valid_2
            left -= 1
            if left == 0 or i + 1 == n:
                mean_1, mean_2 = total_1 / max(count_1, 1.0), total_2 / max(count_2, 1.0)
                for j in range(WIDTH):
                    if b < group[_BLOCKS + j]:
                        at = group[_ROW + j] + b
                        out[at] = lane(mean_1, j)
                        if carts > 1:
                            out[at + group[_BLOCKS + j]] = lane(mean_2, j)
                total_1, total_2, count_1, count_2 = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
                b, left = b + 1, block
            if i + 1 < n:
                t = i * h[g]
                if pushes.shape[0] > 0:
                    push(_of_lanes(pushes, group, 0, i), _of_lanes(pushes, group, 1, i), w)
                x1, v1, x2, v2 = advance(step_lanes, x1, v1, x2, v2, told[k], t, h[g], substeps, table, m, w, q)
                anchor(told[k + _PER_SAMPLE + 1] + offset, told[k + _PER_SAMPLE + 2] + offset, x1, x2, w)
                r1, r2, s1, s2 = measure(x1, v1, x2, v2, t + h[g], h[g], m, w, q)


class LaneReplay:
    """Prepared recordings, held from sample to sample, in groups of lanes.

    Parameters
    ----------
    runs
        Prepared recordings, all of the same carts, and all of velocities or all of positions.

    Attributes
    ----------
    groups
        The numbers of the recordings in every group.
    """

    def __init__(self, runs: Sequence[Run]) -> None:
        alike: dict[tuple[float | None, float, int], list[int]] = {}
        for i, run in enumerate(runs):
            alike.setdefault((run.cutoff, run.sample_time, run.block), []).append(i)
        found = []
        for kind, members in enumerate(alike.values()):
            members.sort(key=lambda i: -len(runs[i].u))
            found += [(kind, members[k : k + WIDTH]) for k in range(0, len(members), WIDTH)]
        # what takes longest begins first
        found.sort(key=lambda group: -len(runs[group[1][0]].u))
        self.groups: list[list[int]] = [members for _kind, members in found]
        # one recording of each kind that the drive's parameters and steps are the same for
        self._kinds = [runs[members[0]] for members in alike.values()]
        self._kind = np.array([kind for kind, _members in found])
        carts = len(runs[0].keep)
        lengths = [len(run.u) for run in runs]
        blocks = [-(-len(run.u) // run.block) for run in runs]
        rows = carts * np.concatenate([[0], np.cumsum(blocks)]).astype(np.int64)
        pushes = 2 * np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        self._places = np.array([(members + [members[0]] * WIDTH)[:WIDTH] for members in self.groups])
        self._table = np.zeros((len(self.groups), _ENTRIES), dtype=np.int64)
        self._starts, parts, begin = np.empty((len(self.groups), 4, WIDTH)), [], 0
        for g, members in enumerate(self.groups):
            n = lengths[members[0]]
            told = np.zeros((n, _PER_SAMPLE, WIDTH))
            told[:, 1:3] = np.nan
            row = self._table[g]
            row[[_BEGIN, _SAMPLES, _BLOCK]] = begin, n, runs[members[0]].block
            for j, i in enumerate(self._places[g]):
                run, own = runs[i], lengths[i]
                row[[_ROW + j, _BLOCKS + j, _PUSHES + j, _LENGTH + j]] = rows[i], blocks[i], pushes[i], own
                told[:own, 0, j], told[:own, 1:3, j] = run.u, run.track.T
                for c in range(carts):
                    told[:own, 3 + 2 * c, j], told[:own, 4 + 2 * c, j] = run.measured[c], run.keep[c]
                self._starts[g, :, j] = run.start
            parts.append(told.ravel())
            begin += told.size
        self._told = np.concatenate(parts)
        self._rows, self._carts = int(rows[-1]), carts
        self._h = np.array([runs[members[0]].sample_time for members in self.groups])

    def residual(
        self,
        values: Mapping[str, float],
        offsets: FloatArray,
        pushes: Sequence[FloatArray] | None = None,
        levels: FloatArray | None = None,
        across: Across | None = None,
    ) -> FloatArray:
        """Return block means of measured minus simulated motion of one drive, in the order of the recordings.

        Other parameters are those of :meth:`~identification.replay.batch.RunBatch.residual`, of all recordings here.

        Parameters
        ----------
        levels : ndarray, shape (recordings, 2)
            Coulomb levels of every run [V], besides those of the drive.
        across
            Maps over groups; default: all by one call.
        """
        p = np.array([drive_vector(values, run) for run in self._kinds])
        steps = np.array([substeps(values, run.sample_time, PHYSICS_S) for run in self._kinds])
        groups = self._table.copy()
        groups[:, _SUBSTEPS], groups[:, _PARAMETERS] = steps[self._kind], N_PARAMETERS * self._kind
        force = np.zeros(0) if pushes is None else np.concatenate([f.ravel() for f in pushes])
        out = np.empty(self._rows)

        def replay(asked: slice) -> None:
            own = np.zeros(0) if levels is None else levels[self._places[asked]].swapaxes(1, 2).ravel()
            replay_lanes(
                groups[asked], self._h[asked], self._told, self._starts[asked], offsets[self._places[asked]], self._carts,
                self._kinds[0].positions, RUNAWAY, p, np.zeros(MEMORIES), np.zeros(WORKSPACES), force, own, out,
            )  # fmt: skip

        if across is None or len(groups) < 2:
            replay(slice(None))
        else:
            list(across(replay, [slice(g, g + 1) for g in range(len(groups))]))
        return out
