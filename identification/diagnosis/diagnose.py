"""From recordings to a diagnosis: split, select, and only then open the report recordings."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from difflib import get_close_matches

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.parameters import checked, parameter
from flexdrive_gym.recording import Recording
from identification.diagnosis.bench import Bench, Values, free
from identification.diagnosis.candidates.catalogue import Candidate
from identification.diagnosis.candidates.free import Shape
from identification.diagnosis.candidates.narrow_band import Line
from identification.diagnosis.candidates.phases import Phase
from identification.diagnosis.fit import intervals
from identification.diagnosis.homogeneity import homogeneity
from identification.diagnosis.select import Round, Scored, Selection, Selector
from identification.diagnosis.settings import Settings
from identification.diagnosis.split import Split, split_recordings
from identification.diagnosis.verdict import Diagnosis, Estimate, Finding, Named, RecordingFit, Unnamed, Verdict
from identification.floor import measure_floor
from identification.replay.output_error import Run, prepare, simulate_run
from identification.topology import Topology, topology_of


def diagnose(
    recordings: Sequence[Recording],
    *,
    alpha: float = 0.02,
    known: Collection[str] = (),
    topology: Topology | None = None,
    jobs: int | None = None,
    seed: int = 0,
    settings: Settings | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Find out which physics the base model of a drive lacks.

    Parameters
    ----------
    recordings
        Of one drive.
    alpha
        Level of the test, between 0 and 1: in so many data sets in which nothing is left out something is named.
    known
        Ids of effects that the base model has already.
    topology
        Which bodies there are and what is free; default: one cart or two, as the recordings' channels tell.
    jobs
        Threads; default: the processors this process may use. The answer does not depend on it.
    seed
        Of the null draws; the same seed gives the same diagnosis to the last bit.
    settings
        Constants; default: those of :class:`~identification.diagnosis.settings.Settings`.
    say
        Called with a few words at every stage.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        For a level outside 0 to 1, an unknown effect, or recordings that cannot tell anything.
    """
    begin = time.perf_counter()
    if not 0.0 < alpha < 1.0:
        raise ValueError(f"alpha: must lie between 0 and 1; got {alpha:g}. The default is 0.02.")
    start = _known(known)
    split = split_recordings(recordings)
    settings = settings or Settings()
    workers = jobs or len(os.sched_getaffinity(0))
    # its own threads keep the processors busy: those of the linear algebra would only be in their way
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(workers) as pool:
        bench = Bench(split.estimation, pool, settings)
        topology = topology or topology_of(split.estimation)
        selection = Selector(bench, topology, start, alpha, seed, say).run()
        sessions = [str(getattr(r, "session", "")) for r in bench.recordings]
        same = homogeneity(selection.model, sessions, alpha, np.random.default_rng([seed, 1]))
    say("opening the report recordings")
    return _result(recordings, split, bench, selection, tuple(same), begin)


def _known(ids: Collection[str]) -> dict[str, float]:
    """Return start values for the sizes of effects that the base model has."""
    found: dict[str, float] = {}
    by = {e.id: e for e in EFFECTS}
    for id_ in ids:
        if id_ not in by:
            near = get_close_matches(id_, by, n=2, cutoff=0.4)
            hint = f"Did you mean {' or '.join(near)}?" if near else "See docs/physics.md for the catalogue."
            raise ValueError(f"known: no effect of the catalogue is called {id_!r}. {hint}")
        effect = by[id_]
        for where in effect.where:
            found |= {
                effect.key(where, q.name): abs(q.starts[0]) for q in effect.parameters if q.role == "size" and q.starts
            }
    return found


def _result(
    recordings: Sequence[Recording],
    split: Split,
    bench: Bench,
    selection: Selection,
    same: tuple[object, ...],
    begin: float,
) -> Diagnosis:
    limits = intervals(selection.model)
    first, model = selection.first.values, selection.model.values
    fits = [
        *(_fit_of(r, first, model, "estimation") for r in bench.recordings),
        *(_fit_of(r, first, model, "report") for r in split.report),
    ]
    judged = list(split.report) or list(bench.recordings)
    findings = tuple(
        Finding(
            Named(*scored.name),
            _estimates(scored, model, limits),
            tuple(Named(*t.name) for t in step.ties()),
            _experiment(scored) if step.ties() else None,
            _share(scored, step),
            scored.significance,
            _rms(judged, step.base.values),
            _rms(judged, scored.fit.values if scored.fit else step.base.values),
        )
        for scored, step in selection.accepted
    )
    unnamed = _unnamed(selection)
    floors = [f.rms for f in measure_floor(judged) if np.isfinite(f.rms)]
    notes = (
        ["All blocks are parts of one recording: nothing is known of what differs from run to run."]
        if split.blocks
        else []
    )
    return Diagnosis(
        _verdict(findings, unnamed),
        tuple(f for r in recordings for f in r.faults),
        findings,
        unnamed,
        _rms(judged, first),
        _rms(judged, model),
        float(np.sqrt(np.mean(np.square(floors)))) if floors else float("nan"),
        tuple(fits),
        same,  # type: ignore[arg-type]
        Drive(checked(model), {k: v for k, v in limits.items() if k in checked(model)}, name="diagnosed drive"),
        Drive(checked(first), name="base model"),
        time.perf_counter() - begin,
        notes=tuple(notes),
        split={
            "estimation": [r.name for r in split.estimation],
            "selection": [r.name for r in split.estimation],
            "report": [r.name for r in (*split.report, *split.loops)],
        },
    )


def _verdict(findings: Sequence[Finding], unnamed: Unnamed | None) -> Verdict:
    if unnamed is not None:
        return "partly_explained" if findings else "unexplained"
    return "explained" if findings else "no_mismatch"


def _share(scored: Scored, step: Round) -> float:
    """Return the share of the whitened square that a finding explains."""
    return float(min(1.0, 2.0 * scored.total / max(float(step.base.normal.square.sum()), 1e-300)))


def _estimates(scored: Scored, model: Values, limits: Mapping[str, tuple[float, float]]) -> dict[str, Estimate]:
    """Return a finding's parameters; of an effect with a phase in every run its amplitude, whose square is chi-squared."""
    candidate = scored.candidate
    if isinstance(candidate, Phase):
        amplitude = float(np.sqrt(2.0) * scored.variability[0].size)
        n = 2 * len(scored.gain)
        low, high = (amplitude * float(np.sqrt(n / chi2.ppf(q, n))) for q in (0.975, 0.025))
        unit = "mm" if candidate.where.startswith("encoder") else "V"
        return {
            "amplitude": Estimate(amplitude, (low, high), unit),
            "P": Estimate(candidate.period, (candidate.period, candidate.period), "mm"),
        }
    if not isinstance(candidate, Candidate):
        return {}
    return {
        k.rsplit(".", 1)[-1]: Estimate(model[k], limits.get(k, (model[k], model[k])), parameter(k).unit)
        for k in candidate.keys
    }


def _unnamed(selection: Selection) -> Unnamed | None:
    last = selection.rounds[-1]
    shape = last.best.candidate
    if not last.accepted or not isinstance(shape, Shape | Line):
        return None
    near = [s for s in last.scored[1:] if not isinstance(s.candidate, Shape | Line) and s.total > 0.0][:3]
    nearest = tuple((s.name[0], float(s.total / last.best.total)) for s in near)
    return Unnamed(
        shape.where,
        _share(last.best, last),
        shape.variable if isinstance(shape, Line) else f"a function of the {shape.variable}",
        nearest,
    )


def _experiment(scored: Scored) -> str | None:
    return next((e.separating_experiment for e in EFFECTS if e.id == scored.name[0]), None) or None


def _fit_of(recording: Recording, first: Values, model: Values, part: str) -> RecordingFit:
    run = free(prepare(recording))
    before, after = (_velocity_errors(run, v) for v in (first, model))
    places = [_position_error(recording, run, v) for v in (first, model)]
    counts = np.sqrt(np.mean(run.floor)) if run.floor else float("nan")
    return RecordingFit(recording.name, part, before, after, float(counts), *places)  # type: ignore[arg-type]


def _velocity_errors(run: Run, values: Values) -> float:
    simulated = simulate_run(values, run)
    error = [run.blocks(c, m - s) for c, (m, s) in enumerate(zip(run.measured, simulated, strict=True))]
    # a block's entry has the variance of one sample: over its root it is a mean
    return float(np.sqrt(np.mean(np.concatenate(error) ** 2) / run.block))


def _position_error(recording: Recording, run: Run, values: Values) -> float | None:
    places = [x for x in (recording.x1, recording.x2) if x is not None]
    if len(places) != len(run.measured):
        return None
    simulated = simulate_run(values, replace(run, positions=True))
    error = [(x - x[0] - s + s[0])[k] for x, s, k in zip(places, simulated, run.keep, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(error) ** 2)))


def _rms(recordings: Sequence[Recording], values: Mapping[str, float]) -> float:
    each = [_velocity_errors(free(prepare(r)), values) for r in recordings]
    return float(np.sqrt(np.mean(np.square(each)))) if each else float("nan")
