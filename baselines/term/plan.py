"""A term on paper: what groups that were examined cost, and what more of them would on other machines."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from baselines.term.study import Row

GROUPS, RECORDINGS = 60, 20
# workers that a plan is made for; one core each
_WORKERS = (1, 2, 4, 8, 16, 32)
# what a plain cable carries, less than half of it used [MB/s]
LINE_MB_S = 50.0


@dataclass(frozen=True)
class Costs:
    """What examining a group cost, measured.

    Attributes
    ----------
    groups, recordings
        Measured, and recordings of all of them.
    seconds, most_seconds
        Of one core for a recording: median and most over groups.
    steps
        Share of the time of each step, 0…1.
    peak_mb
        Most memory of a worker.
    mb_in, mb_out
        Sent to a worker and back for a recording; archives and packed files count as they are.
    """

    groups: int
    recordings: int
    seconds: float
    most_seconds: float
    steps: dict[str, float]
    peak_mb: float
    mb_in: float
    mb_out: float


@dataclass(frozen=True)
class Estimate:
    """What a number of workers would take.

    Attributes
    ----------
    workers
        Of one core each.
    hours, most_hours
        Wall time at the median cost, and at the most that any group took.
    memory_gb
        Of all workers.
    transfer_gb, transfer_minutes
        Sent over the line of the scheduler's machine, in all, and how long it takes at 50 MB/s.
    """

    workers: int
    hours: float
    most_hours: float
    memory_gb: float
    transfer_gb: float
    transfer_minutes: float


def measured(rows: Sequence[Row]) -> Costs:
    """Return what the rows cost.

    Raises
    ------
    ValueError
        If none was identified.
    """
    known = [r for r in rows if r["status"] == "ok"]
    if not known:
        raise ValueError(
            "plan: is made from what groups cost, and none was examined yet. Examine one first: flexdrive term FOLDER -o DIR."
        )
    costs = [r["cost"] for r in known]
    each = [c["cpu_seconds"] / r["recordings"] for c, r in zip(costs, known, strict=True)]
    names = list(dict.fromkeys(name for c in costs for name in c["steps"]))
    whole = sum(c["seconds"] for c in costs)
    count = sum(r["recordings"] for r in known)
    return Costs(
        len(known),
        count,
        statistics.median(each),
        max(each),
        {name: sum(c["steps"].get(name, 0.0) for c in costs) / whole for name in names},
        max(c["peak_mb"] for c in costs),
        sum(c["bytes_in"] for c in costs) / count / 1e6,
        sum(c["bytes_out"] for c in costs) / count / 1e6,
    )


def plan(costs: Costs, groups: int = GROUPS, recordings: int = RECORDINGS) -> tuple[Estimate, ...]:
    """Return what groups of so many recordings would take on 1 to 32 cores; a group is not divided.

    Time goes with the number of recordings, which all steps read through; starting a worker, some ten seconds, is left out.
    """
    found = []
    for workers in _WORKERS:
        rounds = -(-groups // workers)
        transfer = groups * recordings * (costs.mb_in + costs.mb_out) / 1e3
        found.append(
            Estimate(
                workers,
                rounds * recordings * costs.seconds / 3600.0,
                rounds * recordings * costs.most_seconds / 3600.0,
                min(workers, groups) * costs.peak_mb / 1e3,
                transfer,
                transfer * 1e3 / LINE_MB_S / 60.0,
            )
        )
    return tuple(found)


def as_json(costs: Costs, estimates: Sequence[Estimate], groups: int, recordings: int) -> dict[str, Any]:
    """Return a plan as JSON knows it."""
    return {
        "groups": groups,
        "recordings": recordings,
        "measured": asdict(costs),
        "workers": [asdict(e) for e in estimates],
    }
