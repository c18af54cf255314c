"""The controllers of a comparison that a reader sees first."""

from __future__ import annotations

from baselines.compare.result import Result
from baselines.compare.results import Comparison
from baselines.controllers import KINDS

MOST = 8
YARDSTICK = "p_control"
_RIG_TIME_S = 1.001e-3


def shortlist(comparison: Comparison, most: int = MOST) -> tuple[Result, ...]:
    """Return the controllers that matter most, in the order of the comparison.

    Parameters
    ----------
    most
        How many at most.

    Returns
    -------
    tuple of Result
        All, where there are no more. Otherwise the reader's own controllers, P-control from x2 as the yardstick, the best learnt
        policy, and the best of the other kinds; the best settles in every dwell and has the least rms error. Designs for a
        slower sample time, and designs told the reference ahead, stand for no kind.
    """
    results = comparison.results
    if len(results) <= most:
        return results
    kinds: dict[str, list[Result]] = {}
    for r in results:
        kinds.setdefault(_kind(r), []).append(r)
    best = {kind: min(found, key=_rank) for kind, found in kinds.items() if kind not in {"own", "variant"}}
    if YARDSTICK in kinds:
        best[YARDSTICK] = next((r for r in kinds[YARDSTICK] if r.entry.name == "p_x2"), best[YARDSTICK])
    first = [*kinds.get("own", []), *(best.pop(kind) for kind in (YARDSTICK, "learnt") if kind in best)]
    chosen = [*first, *sorted(best.values(), key=_rank), *sorted(kinds.get("variant", []), key=_rank)][:most]
    return tuple(r for r in results if r in chosen)


def _kind(result: Result) -> str:
    entry = result.entry
    name = entry.name.partition("@")[0].partition("+")[0]
    if entry.learnt:
        return "learnt"
    if name not in KINDS:
        return "own"
    return "variant" if "+" in entry.name or entry.period > _RIG_TIME_S else KINDS[name]


def _rank(result: Result) -> tuple[bool, float]:
    return not result.nominal.success, result.nominal.rms
