"""The ladder: the drive with one finding more at every rung, each fitted to what was measured.

The search compares velocities, because they say when an error was made. The ladder answers another question, how well the
recordings are predicted, so it fits positions where only positions were recorded, and whole recordings instead of parts. Every
run starts in the state that its first samples tell.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from flexdrive_gym import Drive, Provenance, Recording, __version__
from identification.initial_state import with_start
from identification.mismatch.crew import Crew
from identification.mismatch.refit import Fit, refit
from identification.mismatch.rounds import Progress
from identification.mismatch.verdict import Diagnosis
from identification.mismatch.workbench import Workbench
from identification.replay.output_error import prepare_measured
from identification.topology import Topology

_ROUNDS, _ITERATIONS = 3, 12


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


def climb(
    found: Diagnosis,
    recordings: Sequence[Recording],
    topology: Topology,
    *,
    window: int,
    jobs: int | None = None,
    say: Progress = lambda _: None,
) -> tuple[Rung, ...]:
    """Fit the free drive, then the drive with each finding added in the order in which the search took them up.

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
    learnt: Mapping[str, float] = (found.learnt or found.drive).values
    steps: list[tuple[str, tuple[str, ...], Mapping[str, float]]] = [(topology.name, (), {})]
    steps += [(name, tuple(keys), held) for name, (keys, held) in found.extra["order"].items()]
    rungs: list[Rung] = []
    names = list(topology.free)
    kept: dict[str, float] = {}
    before: Mapping[str, float] = found.free.values
    with Crew(jobs or len(os.sched_getaffinity(0))) as pool:
        for name, keys, held in steps:
            say(f"fitting the ladder: {name}")
            names += keys
            kept |= held
            own = {k: learnt[k] for k in names if k in learnt}
            last = {k: before[k] for k in names if k in before}
            starts = [{**own, **kept}, {**own, **last, **kept}]
            fits = [fit_measured(start, names, recordings, topology, window, pool) for start in starts]
            before = min(fits, key=lambda f: f.cost).values
            note = "; ".join(r.name for r in rungs[1:]) + (f"; {name}" if rungs else "")
            drive = Drive(
                before,
                provenance=Provenance("ladder", tuple(r.name for r in recordings), __version__, note.strip("; ")),
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
    pool: Crew,
) -> Fit:
    """Fit parameters to what was measured, start states and weights anew in every round; the cost is unweighted."""
    runs = [prepare_measured(r) for r in recordings]
    values: Mapping[str, float] = {**topology.fixed, **start}
    for _ in range(_ROUNDS):
        begin = partial(with_start, values, window=window, moving=topology.moving)
        runs = list(pool.map(begin, runs))
        bench = Workbench(runs, pool)
        bench.weigh(bench.residual(values))
        fit = refit(bench, values, names, iterations=_ITERATIONS)
        values = fit.values
    e = bench.residual(values)[bench.rows.valid]
    return replace(fit, cost=float(e @ e))
