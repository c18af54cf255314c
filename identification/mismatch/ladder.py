"""The ladder: the drive with one finding more at every rung, each fitted to what was measured.

The selection compares velocities, because they say when an error was made. The ladder answers another question, how well the
recordings are predicted, so it fits positions where only positions were recorded, and whole recordings instead of parts. Every
run starts in the state that its first samples tell.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

from threadpoolctl import threadpool_limits

from flexdrive_gym import Drive, Provenance, Recording, __version__
from identification.initial_state import with_start
from identification.mismatch.bench import Bench, free
from identification.mismatch.fit import fit
from identification.mismatch.levels import Levels
from identification.mismatch.settings import Settings
from identification.mismatch.verdict import Diagnosis
from identification.replay.batch import Together
from identification.replay.output_error import Run, prepare_measured
from identification.topology import Topology

_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Rung:
    """A drive of the ladder.

    Attributes
    ----------
    name
        Effect and place that it adds, as ``stribeck@cart_1``; the topology's name for the first.
    drive
        Fitted to the recordings.
    """

    name: str
    drive: Drive


class _Measured(Bench):
    """Recordings compared by what was measured, each from a start state of its own.

    Parameters
    ----------
    recordings
        Of one drive; all by velocity, or all by position.
    begin
        Gives a run its start state.
    """

    def __init__(self, recordings: Sequence[Recording], begin: Callable[[Run], Run], pool: ThreadPoolExecutor) -> None:
        super().__init__(recordings, pool, Settings())
        self.runs = list(pool.map(begin, map(prepare_measured, self.recordings)))
        self._batches = [(slice(0, len(self.runs)), Together([free(run) for run in self.runs]))]


def climb(
    found: Diagnosis,
    recordings: Sequence[Recording],
    topology: Topology,
    *,
    window: int,
    jobs: int | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> tuple[Rung, ...]:
    """Fit the base model, then the drive with each finding added in the order in which they were accepted.

    Parameters
    ----------
    found
        A diagnosis of these recordings or parts of them.
    recordings
        To fit to.
    topology
        That of the diagnosis.
    window
        First samples of every recording that its start state may be found from.
    """
    steps = [(topology.name, ()), *((f.name, f.keys) for f in found.findings if f.keys)]
    rungs: list[Rung] = []
    names = list(topology.free)
    before: Mapping[str, float] = found.base.values
    with (
        threadpool_limits(1, user_api="blas"),
        ThreadPoolExecutor(jobs or len(os.sched_getaffinity(0))) as pool,
    ):
        for name, keys in steps:
            say(f"fitting the ladder: {name}")
            names += keys
            own = {k: found.drive[k] for k in names}
            starts = [own, {**own, **{k: before[k] for k in names if k in before}}]
            fits = [fit_measured(start, names, recordings, topology, window, pool) for start in starts]
            before = min(fits, key=lambda item: item[1])[0]
            note = "; ".join([*(r.name for r in rungs[1:]), *([name] if rungs else [])])
            drive = Drive(
                before,
                provenance=Provenance("ladder", tuple(r.name for r in recordings), __version__, note),
                name=name,
            )
            rungs.append(Rung(name, drive))
    return tuple(rungs)


def fit_measured(
    start: Mapping[str, float],
    names: Sequence[str],
    recordings: Sequence[Recording],
    topology: Topology,
    window: int,
    pool: ThreadPoolExecutor,
) -> tuple[dict[str, float], float]:
    """Fit parameters to what was measured, start states and weights anew in every round.

    Returns
    -------
    dict
        The drive.
    float
        Its unweighted squared error.
    """
    values = {**topology.fixed, **start}
    for _ in range(_ROUNDS):
        bench = _Measured(recordings, partial(with_start, values, window=window, moving=topology.moving), pool)
        best = fit(bench, Levels.of(bench, bench.residual(values)), values, names)
        values = best.values
    e = best.residual[bench.valid]
    return values, float(e @ e)
