"""All controllers on the same drives: nominal, drawn from the identified covariance, and with each left-out effect.

A *case* is a drive with a name; a *job* is one controller on a block of cases. Cases are drawn once from the seed, so controllers
are compared on the same drives, and a block's size does not depend on who computes it: results are the same for every backend
and number of jobs. Jobs go through joblib, so where they run is one option away. Dask runs a job again elsewhere when the worker
that had it is lost.

A controller that is no :class:`~flexdrive_gym.LinearController` is a black box: it is called sample by sample and has no
analytic margins, but everything else is measured alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Any, Literal

import numpy as np

from baselines.controllers import FAMILIES, SAMPLE_TIME_S, design
from baselines.empirical_margins import EmpiricalMargins, empirical_margins
from baselines.execution import Backend, Progress, run_jobs
from baselines.margins import Margins, margins
from baselines.metrics import NAMES, TOLERANCE_MM, TRAVEL_MM, Measures, measure
from baselines.shares import Share, share
from baselines.stability_limit import with_rig
from flexdrive_gym import Controller, Drive, LinearController, Observation
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.linear_controller import run_batch
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import handout_trajectory

DURATION_S = 4.0
DRAWS = 500
BLOCK = 25


@dataclass(frozen=True, eq=False)
class Entry:
    """A controller in the comparison.

    Attributes
    ----------
    name
        Unique.
    controller
        Anything with the protocol; it travels to other processes, so it must pickle.
    title
        In words.
    feedback
        Which encoders it reads.
    notes
        Of its design.
    """

    name: str
    controller: Controller
    title: str = ""
    feedback: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Case:
    """A drive on which every controller runs; ``group`` is ``nominal``, ``draw`` or ``effect``."""

    name: str
    group: Literal["nominal", "draw", "effect"]
    drive: Drive


@dataclass(frozen=True, eq=False)
class Result:
    """What the comparison found of one controller.

    Attributes
    ----------
    nominal
        On the identified drive with its friction, counts and limit.
    margins
        By python-control on the linear drive, or ``None`` for a black box.
    empirical
        By trial, or ``None`` where not asked for.
    draws, stable_draws
        Shares of success and of stability over the drawn drives, or ``None`` without draws.
    draw_rms
        5 %, 50 % and 95 % point of the rms error over the drawn drives [mm].
    effects
        Case to measures.
    measures
        Every case's measures, ndarray, shape (cases, len(NAMES)).
    """

    entry: Entry
    nominal: Measures
    margins: Margins | None
    empirical: EmpiricalMargins | None
    draws: Share | None
    stable_draws: Share | None
    draw_rms: tuple[float, float, float] | None
    effects: Mapping[str, Measures]
    measures: FloatArray

    @property
    def effect_share(self) -> Share | None:
        """Share of effects at their typical size with which the controller still succeeds."""
        return share([m.success for m in self.effects.values()])


@dataclass(frozen=True, eq=False)
class Comparison:
    """All controllers on all cases.

    Attributes
    ----------
    results
        In the order of the entries.
    skipped
        Controller to the reason why it is not there.
    """

    drive: Drive
    cases: tuple[Case, ...]
    results: tuple[Result, ...]
    limit: float
    tolerance: float
    duration: float
    seed: int
    skipped: Mapping[str, str] = field(default_factory=dict)


def entries(
    drive: Drive, names: Sequence[str] = (), *, limit: float = inf, sample_time: float = SAMPLE_TIME_S
) -> tuple[list[Entry], dict[str, str]]:
    """Design controllers by name; what cannot be designed is returned with its reason.

    Parameters
    ----------
    names
        Keys of :data:`~baselines.controllers.FAMILIES`; empty for all.
    limit
        Of the command [V].

    Raises
    ------
    ValueError
        For an unknown name, or if nothing can be designed.
    """
    found: list[Entry] = []
    skipped: dict[str, str] = {}
    for name in names or FAMILIES:
        if name not in FAMILIES:
            design(name, drive)  # raises with the near match
        try:
            made = design(name, drive, limit=limit, sample_time=sample_time)
        except (ImportError, ValueError) as error:
            skipped[name] = str(error)
            continue
        found.append(Entry(name, made.controller, made.title, made.feedback, made.notes))
    if not found:
        raise ValueError("controllers: none can be designed; " + "; ".join(f"{k}: {v}" for k, v in skipped.items()))
    return found, skipped


def typical_effects(drive: Drive) -> list[Case]:
    """Return the drive with each effect of the catalogue that it lacks, one at a time, at typical size.

    The size is the effect's own (the first start value of its parameters). An effect at a place that the drive already has,
    identified or the rig's, is left as it is.
    """
    cases = []
    for effect in EFFECTS:
        for where in effect.where:
            keys = {effect.key(where, p.name): p for p in effect.parameters}
            if any(key in drive.values for key in keys) or (drive.carts == 1 and _needs_second_cart(where)):
                continue
            values = {key: p.starts[0] for key, p in keys.items() if p.starts}
            if values:
                name = effect.id if len(effect.where) == 1 else f"{effect.id}, {where}"
                cases.append(Case(name, "effect", drive.replace(values, name=f"{drive.name} with {name}")))
    return cases


def _needs_second_cart(where: str) -> bool:
    return where in {"cart_2", "encoder_2", "spring"}


def cases_of(drive: Drive, *, draws: int = DRAWS, effects: bool = True, seed: int = 0) -> list[Case]:
    """Return the cases: the drive itself, drawn drives, and the drive with each left-out effect.

    Parameters
    ----------
    drive
        The handout's encoder counts and command limit are added where it has none.
    draws
        From the identified covariance; 0 for none.
    effects
        Whether each left-out effect at its typical size is a case.
    seed
        Of the draws.

    Raises
    ------
    ValueError
        If draws are asked for and the drive has no covariance.
    """
    rig = with_rig(drive)
    cases = [Case(drive.name, "nominal", rig)]
    if draws:
        drawn = rig.draw(np.random.default_rng(seed), draws)
        cases += [Case(f"draw {i + 1}", "draw", d) for i, d in enumerate(drawn)]
    if effects:
        cases += typical_effects(rig)
    return cases


def run_controller(
    controller: Controller, drives: Sequence[Drive], xr: FloatArray, sample_time: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Run one controller on several drives; return (states of shape (4, n), u) of each.

    A linear controller runs in the compiled loop. For a black box the states are what ideal encoders would say.
    """
    if isinstance(controller, LinearController) and controller.sample_time == sample_time:
        out = run_batch(drives, xr, controller)
        return [(run[:4], run[4]) for run in out]
    t = np.arange(len(xr)) * sample_time
    found = []
    # what previews its reference must hear which it is
    following = getattr(controller, "following", None)
    if following is not None:
        controller = following(xr)
    for drive in drives:
        seen = _Watched(controller, drive.carts)
        run = drive.simulate_closed_loop(t, xr, seen)
        x2 = run.x2 if run.x2 is not None else run.x1
        assert run.x1 is not None
        assert x2 is not None
        v1, v2 = np.gradient(run.x1, sample_time), np.gradient(x2, sample_time)
        found.append((np.array([run.x1, v1, x2, v2]), run.u))
    return found


@dataclass
class _Watched:
    """A black box whose command is always a number: what is not becomes 0, and the run shows it."""

    inner: Controller
    carts: int

    def reset(self) -> None:
        reset = getattr(self.inner, "reset", None)
        if reset is not None:
            reset()

    def __call__(self, observation: Observation, /) -> float:
        u = float(self.inner(observation))
        return u if isfinite(u) else 0.0


def _block(
    controller: Controller, drives: Sequence[Drive], duration: float, sample_time: float, limit: float, tolerance: float
) -> FloatArray:
    """Run one job; return measures, ndarray, shape (drives, len(NAMES))."""
    xr = handout_trajectory(np.arange(round(duration / sample_time) + 1) * sample_time)
    rows = []
    for drive, (states, u) in zip(drives, run_controller(controller, drives, xr, sample_time), strict=True):
        of = measure(
            drive,
            xr,
            states,
            u,
            sample_time,
            limit=min(limit, drive.voltage_limit),
            tolerance=tolerance,
            travel=TRAVEL_MM,
        )
        rows.append([float(getattr(of, name)) for name in NAMES])
    return np.array(rows)


def _margins(
    controller: Controller, drive: Drive, sample_time: float, empirical: bool
) -> tuple[Margins | None, EmpiricalMargins | None]:
    """Return analytic and empirical margins of one controller."""
    analytic = margins(drive, controller) if isinstance(controller, LinearController) else None
    if not empirical or (analytic is not None and not analytic.stable):
        return analytic, None
    try:
        return analytic, empirical_margins(drive, controller, sample_time=sample_time)
    except ValueError:  # a black box that grows by itself has none
        return analytic, None


def compare(
    drive: Drive,
    controllers: Sequence[Entry],
    *,
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
        What competes; see :func:`entries`.
    cases
        Default: :func:`cases_of` the drive.
    duration
        Of a run on the handout's trajectory [s].
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
    names = [entry.name for entry in controllers]
    if len(set(names)) < len(names):
        raise ValueError(f"controllers: names must be unique; got {', '.join(names)}.")
    chosen = cases_of(drive, seed=seed) if cases is None else list(cases)
    rig = with_rig(drive)
    blocks = [[c.drive for c in chosen[i : i + BLOCK]] for i in range(0, len(chosen), BLOCK)]
    work: list[tuple[Callable[..., Any], tuple[Any, ...]]] = [
        (_block, (entry.controller, block, duration, _period(entry), limit, tolerance))
        for entry in controllers
        for block in blocks
    ]
    work += [(_margins, (entry.controller, rig, _period(entry), empirical)) for entry in controllers]
    found = run_jobs(work, backend, jobs, scheduler, progress)
    per = len(blocks)
    results = []
    for i, entry in enumerate(controllers):
        table = np.vstack(found[i * per : (i + 1) * per])
        analytic, by_trial = found[len(controllers) * per + i]
        results.append(_result(entry, chosen, table, analytic, by_trial))
    return Comparison(rig, tuple(chosen), tuple(results), limit, tolerance, duration, seed, dict(skipped or {}))


def _period(entry: Entry) -> float:
    return float(getattr(entry.controller, "sample_time", SAMPLE_TIME_S))


def _result(
    entry: Entry, cases: Sequence[Case], table: FloatArray, analytic: Margins | None, by_trial: EmpiricalMargins | None
) -> Result:
    all_measures = [_as_measures(row) for row in table]
    drawn = [m for m, c in zip(all_measures, cases, strict=True) if c.group == "draw"]
    low, middle, high = np.quantile([m.rms for m in drawn], (0.05, 0.5, 0.95)) if drawn else (inf, inf, inf)
    return Result(
        entry=entry,
        nominal=next(m for m, c in zip(all_measures, cases, strict=True) if c.group == "nominal"),
        margins=analytic,
        empirical=by_trial,
        draws=share([m.success for m in drawn]),
        stable_draws=share([m.stable for m in drawn]),
        draw_rms=(float(low), float(middle), float(high)) if drawn else None,
        effects={c.name: m for m, c in zip(all_measures, cases, strict=True) if c.group == "effect"},
        measures=table,
    )


def _as_measures(row: FloatArray) -> Measures:
    values: dict[str, Any] = dict(zip(NAMES, map(float, row), strict=True))
    return Measures(**{**values, "stable": values["stable"] > 0.5, "success": values["success"] > 0.5})


def headline(comparison: Comparison) -> list[str]:
    """Say in sentences what the comparison found."""
    ranked = sorted(comparison.results, key=lambda r: (not r.nominal.success, r.nominal.rms))
    best = ranked[0]
    said = []
    if best.nominal.success:
        said.append(
            f"Least tracking error among those that settle within {comparison.tolerance:g} mm in every dwell: {best.entry.name}, "
            f"{best.nominal.rms:.2f} mm rms, {best.nominal.peak:.1f} mm peak."
        )
        failed = [r.entry.name for r in ranked if not r.nominal.success]
        if failed:
            said.append(f"Do not settle on the identified drive: {', '.join(failed)}.")
    else:
        said.append(f"No controller settles within {comparison.tolerance:g} mm in every dwell.")
    # alike on every draw: then the draws say nothing of who is more robust
    drawn = [r for r in comparison.results if r.draws is not None and r.nominal.success]
    fragile = [r for r in drawn if r.draws is not None and r.draws.value < 1.0]
    if drawn and not fragile:
        said.append("Every controller that settles on the identified drive settles on all drawn drives.")
    said += [
        f"{r.entry.name} settles on {r.draws.value:.1%} of the drawn drives." for r in fragile if r.draws is not None
    ]
    for r in comparison.results:
        lost = [name for name, m in r.effects.items() if not m.stable]
        if lost:
            said.append(f"{r.entry.name} becomes unstable with: {'; '.join(lost)}.")
    off = [
        max(abs(e.gain_margin / m.gain_margin - 1.0), abs(e.delay_margin / m.delay_margin - 1.0))
        for r in comparison.results
        for m, e in [(r.margins, r.empirical)]
        if m is not None and e is not None and isfinite(m.gain_margin) and isfinite(m.delay_margin)
        and isfinite(e.gain_margin) and isfinite(e.delay_margin)
    ]  # fmt: skip
    if off:
        said.append(f"Margins found by trial agree with python-control's to {max(off):.1%}.")
    return said
