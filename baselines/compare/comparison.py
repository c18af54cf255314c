"""Running the comparison: every controller on every case.

A *job* is one controller on a block of cases along one reference. A block's size does not depend on who computes it, so results
are the same for every backend and number of jobs. Jobs go through joblib, so where they run is one option away. Dask runs a job
again elsewhere when the worker that had it is lost.

A controller that is no :class:`~flexdrive_gym.LinearController` is a black box: it has no analytic margins, but everything else
is measured alike, on the same 1 kHz rig.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from math import inf
from typing import Any

import numpy as np

from baselines.compare.cases import DRAWS, UNSEEN_REFERENCES, Case, Reference, cases_of, named_reference
from baselines.compare.entries import Entry
from baselines.compare.own import as_entries
from baselines.compare.result import result_of
from baselines.compare.results import Comparison
from baselines.evaluation.metrics import NAMES, TOLERANCE_MM, TRAVEL_MM, measure
from baselines.evaluation.parallel import Backend, Progress, run_jobs
from baselines.evaluation.rollout import RIG_TIME_S, Previewed, run_many
from baselines.loop_analysis.empirical_margins import EmpiricalMargins, NoMarginsError, On, empirical_margins
from baselines.loop_analysis.margins import Margins, margins
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import Controller, Drive, LinearController
from flexdrive_gym.recording import FloatArray

DURATION_S = 4.0
# a policy is asked for so many rigs at once; a compiled controller gains nothing by more
BLOCK = {False: 25, True: 100}


def instants(duration: float) -> FloatArray:
    """Return the rig's sample instants [s], ndarray, shape (n,)."""
    return np.asarray(np.arange(round(duration / RIG_TIME_S) + 1) * RIG_TIME_S, dtype=np.float64)


def compare(
    drive: Drive,
    controllers: Sequence[Entry] | Mapping[str, Controller | Entry],
    *,
    draws: int | None = None,
    effects: bool = True,
    references: Sequence[Reference | str] = UNSEEN_REFERENCES,
    cases: Sequence[Case] | None = None,
    duration: float = DURATION_S,
    limit: float = inf,
    tolerance: float = TOLERANCE_MM,
    empirical: bool = True,
    seed: int = 0,
    backend: Backend = "loky",
    jobs: int = -1,
    scheduler: str | None = None,
    skipped: Mapping[str, str] | None = None,
    progress: Progress = lambda _done, _all: None,
) -> Comparison:
    """Compare controllers on the same drives.

    Parameters
    ----------
    drive
        The identified drive.
    controllers
        What competes: controllers by name, ``{"mine": controller}``, or entries; see
        :func:`~baselines.compare.entries.entries`.
    draws
        Drives drawn from the identified covariance; ``None``: 500 where there is one, else none.
    effects
        Whether each left-out effect at its typical size is a case.
    references
        Beside the handout's trajectory, for example ``"sine:amplitude=10"``, in the rig's units.
    cases
        Instead of what draws, effects and references say; see :func:`~baselines.compare.cases.cases_of`.
    duration
        Of a run [s].
    limit
        Of the command [V], for the share of limited samples.
    tolerance
        For settling and success [mm].
    empirical
        Whether margins are also found by trial.
    seed
        Of the draws, for the default cases.
    backend
        ``threading``, ``loky`` (processes), ``dask`` or ``sequential``.
    jobs
        Workers for ``threading`` and ``loky``; -1: as many as there are cores.
    scheduler
        Address of the Dask scheduler, for ``dask``.
    skipped
        Passed on to the result.
    progress
        Told how many jobs of how many are done.

    Raises
    ------
    ValueError
        For names that are not unique, an unknown backend, or ``dask`` without an address.
    """
    entries = as_entries(controllers)
    names = [entry.name for entry in entries]
    if not names:
        raise ValueError("controllers: must be at least one; got none.")
    if len(set(names)) < len(names):
        raise ValueError(f"controllers: names must be unique; got {', '.join(names)}.")
    if cases is None:
        along = [named_reference(r, drive.units) if isinstance(r, str) else r for r in references]
        many = (DRAWS if drive.covariance is not None else 0) if draws is None else draws
        cases = cases_of(drive, draws=many, effects=effects, references=along, seed=seed)
    chosen = tuple(cases)
    rig = with_rig(drive)
    work: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []
    of: list[Entry] = []
    # what takes longest first, so that no core waits for one late job
    for entry in sorted(entries, key=lambda e: not e.learnt):
        work.append((_margins, (entry.loop, rig, empirical)))
        of.append(entry)
        for reference, drives in _blocks(chosen, BLOCK[entry.learnt]):
            work.append((_block, (entry.controller, drives, reference, duration, limit, tolerance)))
            of.append(entry)
    found: dict[str, list[Any]] = {name: [] for name in names}
    for entry, answer in zip(of, run_jobs(work, backend, jobs, scheduler, progress), strict=True):
        found[entry.name].append(answer)
    results = tuple(result_of(e, chosen, np.vstack(found[e.name][1:]), *found[e.name][0]) for e in entries)
    return Comparison(rig, chosen, results, limit, tolerance, duration, seed, dict(skipped or {}))


def _blocks(cases: Sequence[Case], size: int) -> list[tuple[Reference, list[Drive]]]:
    """Return the cases in their order, cut where the reference changes and after so many."""
    found = []
    for reference, group in groupby(cases, key=lambda c: c.reference):
        drives = [case.drive for case in group]
        found += [(reference, drives[i : i + size]) for i in range(0, len(drives), size)]
    return found


def _block(
    controller: Controller | Previewed,
    drives: Sequence[Drive],
    reference: Reference,
    duration: float,
    limit: float,
    tolerance: float,
) -> FloatArray:
    """Run one job; return measures, ndarray, shape (drives, len(NAMES))."""
    xr = reference.sampled(instants(duration))
    rows = []
    for drive, run in zip(drives, run_many(controller, drives, xr), strict=True):
        least = min(limit, drive.voltage_limit)
        of = measure(drive, xr, run[:4], run[4], RIG_TIME_S, limit=least, tolerance=tolerance, travel=TRAVEL_MM)
        rows.append([float(getattr(of, name)) for name in NAMES])
    return np.array(rows)


def _margins(
    controller: Controller, drive: Drive, empirical: bool
) -> tuple[Margins | None, EmpiricalMargins | None, EmpiricalMargins | None, float | None]:
    """Return margins of one controller: analytic, by trial on the linear drive, by trial with friction; and the swing there."""
    # without friction a policy may vibrate by itself; what counts of it is the rig
    analytic = margins(drive, controller) if isinstance(controller, LinearController) else None
    if not empirical:
        return analytic, None, None, None
    on_linear = _by_trial(drive, controller, "linear")[0] if analytic is not None and analytic.stable else None
    return analytic, on_linear, *_by_trial(drive, controller, "full")


def _by_trial(drive: Drive, controller: Controller, on: On) -> tuple[EmpiricalMargins | None, float]:
    try:
        found = empirical_margins(drive, controller, on=on)
    except NoMarginsError as error:  # what grows by itself has none
        return None, error.swing
    return found, found.swing
