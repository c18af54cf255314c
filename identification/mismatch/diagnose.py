"""From recordings to a diagnosis: read, split, select, and only then open the report recordings."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from flexdrive_gym import Drive, Provenance, Recording, __version__
from flexdrive_gym.drive.parameters import checked, parameter
from identification.mismatch.answer.baseline import fit_tied, ratios
from identification.mismatch.answer.covariance import uncertainty
from identification.mismatch.answer.errors import loop_fits, recording_fits, total, velocity_rms
from identification.mismatch.answer.finding import Estimate, Finding, Named, Unnamed, experiment_for, short, unit_of
from identification.mismatch.answer.homogeneity import Homogeneity, homogeneity
from identification.mismatch.answer.notes import notes_of
from identification.mismatch.answer.unnamed import share_of, unnamed
from identification.mismatch.answer.verdict import Diagnosis, RecordingFit, Verdict, in_units
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.fit import Fit, fit
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.force.maps import draw_maps, harmonics, located
from identification.mismatch.force.missing_force import missing_force
from identification.mismatch.noise.simulator import Simulator
from identification.mismatch.selection.detection import DetectionLimit
from identification.mismatch.selection.naming import Naming
from identification.mismatch.selection.optima import without
from identification.mismatch.selection.output_error import needed, output_error, share_of_error
from identification.mismatch.selection.ranking import Round, Scored, dispensable
from identification.mismatch.selection.selector import Selection, Selector
from identification.mismatch.settings import Settings
from identification.mismatch.split import Split, split_recordings
from identification.recordings import RecordingSet, Rig
from identification.recordings.given import Source, given
from identification.run_to_run import friction_run_to_run, recorded_range
from identification.selection import select
from identification.topology import Topology, topology_of

Say = Callable[[str], None]
ALPHA = 0.02
# an error this near to the floor leaves nothing to explain
_NEAR_FLOOR = 1.25


def diagnose(
    recordings: Source,
    *,
    seed: int = 0,
    jobs: int | None = None,
    topology: Topology | None = None,
    rig: Rig | str | Path | None = None,
    alpha: float = ALPHA,
    settings: Settings | None = None,
    say: Say = lambda _: None,
) -> Diagnosis:
    """Find out which physics the base model of a drive lacks.

    Parameters
    ----------
    recordings
        Folder, files, or recordings already read, of one drive.
    seed
        Of the null draws; the same seed gives the same diagnosis to the last bit.
    jobs
        Threads; default: the processors this process may use. The answer does not depend on it.
    topology
        Which bodies there are and what is free; default: one cart or two, as the recordings' channels or their rig description
        tell, with the effects that it knows.
    rig
        Rig description, or its file, to read recordings with; those already read bring theirs.
    alpha
        Level of the test, between 0 and 1: in so many data sets in which nothing is left out something is named.
    settings
        Constants; default: those of :class:`~identification.mismatch.settings.Settings`.
    say
        Called with a few words at every stage.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ValueError
        For a level outside 0 to 1, or recordings that cannot tell anything; the message says what to record.
    """
    begin = time.perf_counter()
    if not 0.0 < alpha < 1.0:
        raise ValueError(f"alpha: must lie between 0 and 1; got {alpha:g}. The default is {ALPHA:g}.")
    say("reading recordings")
    chosen = select(given(recordings, rig))
    runs = chosen.require()
    split = split_recordings(runs)
    bodies = topology or topology_of(RecordingSet(split.estimation, rig=runs.rig))
    # its own threads keep the processors busy: those of the linear algebra would only be in their way
    with (
        threadpool_limits(1, user_api="blas"),
        ThreadPool(jobs or len(os.sched_getaffinity(0))) as pool,
    ):
        bench = Bench(split.estimation, pool, settings or Settings())
        plain, known = without_known(bodies)
        selection = Selector(bench, plain, known, alpha, seed, say).run()
        found = _Result(split, bench, selection, plain, pool, seed)
        say("estimating what is uncertain")
        same = found.homogeneity(alpha, np.random.default_rng([seed, 1]))
        say("opening the report recordings")
        result = found.diagnosis(same)
    # what was left out has faults, too
    faults = [f for r in (*runs, *(r for r, _ in chosen.left_out)) for f in r.in_rig_units().faults]
    return replace(
        result, faults=tuple(faults), notes=(*chosen.notes, *result.notes), seconds=time.perf_counter() - begin
    )


def without_known(topology: Topology) -> tuple[Topology, dict[str, float]]:
    """Return the bodies alone, and the start values of the effects that a topology knows."""
    known = {n: v for n, v in topology.start.items() if "." in n and n in topology.free}
    # what is at its null has no slope to be fitted from
    usual = {n: v or 1e-6 for n, v in known.items()}
    start = {n: v for n, v in topology.start.items() if n not in known}
    return replace(topology, free=tuple(n for n in topology.free if n not in known), start=start), usual


@dataclass(eq=False)
class _Result:
    """What was selected, on its way to a diagnosis; figures in the engine's units until the end."""

    split: Split
    bench: Bench
    selection: Selection
    topology: Topology
    pool: Executor
    seed: int

    @cached_property
    def base(self) -> Fit:
        return output_error(self.bench, self.selection.first)

    @property
    def model(self) -> Fit:
        return self._lasting[0]

    @property
    def accepted(self) -> list[tuple[Scored, Round]]:
        """Accepted candidates, but for those that the simulation does not need: the reported drive has no such effect."""
        return self._lasting[1]

    @cached_property
    def _lasting(self) -> tuple[Fit, list[tuple[Scored, Round]]]:
        accepted, model = list(self.selection.accepted), self.selection.model
        naming, step = Naming(self.bench, self.selection.level), self.selection.rounds[-1]
        while accepted:
            last = self._by_output_error(model, self.base)
            # a name that stands alone was asked in its round
            asked = dispensable([s for s, _ in accepted]) if len(self.selection.accepted) > 1 else []
            first, settings = self.selection.accepted[0][0], self.bench.settings
            shares = list(self.pool.map(partial(share_of_error, best=last), asked))
            if first in asked and isinstance(first.candidate, Candidate):
                shares[asked.index(first)] = naming.share_of_first(replace(first, fit=last), step, self.base)
            taken_off = sorted(zip(shares, asked, strict=True), key=lambda item: item[0])
            idle = next((s for x, s in taken_off if not needed(s, x, first=s is first, settings=settings)), None)
            # the drive that is reported must have it
            idle = next((s for s, _ in accepted if _of_no_size(s, last)), idle)
            if idle is None:
                return last, accepted
            accepted = [(s, step) for s, step in accepted if s is not idle]
            if isinstance(idle.candidate, Candidate):
                names = [n for n in model.names if n not in idle.candidate.keys]
                noise = self.selection.rounds[-1].noise
                model = fit(self.bench, noise, without(idle.candidate, model.values, names), names)
        return self.base, []

    @property
    def runs(self) -> Sequence[Recording]:
        return self.bench.recordings

    def homogeneity(self, alpha: float, rng: np.random.Generator) -> tuple[Homogeneity, ...]:
        """Hold the parameters against the sessions, in the rig's units."""
        model, units = self.model, self.runs[0].units
        # replicates in different sessions are what tells them apart
        single = copy(self.bench)
        single.units = np.arange(len(self.runs))
        own = replace(model, bench=single, known=model.jacobian)
        one = {n: units.one(unit_of(n)) for n in model.names}
        return tuple(homogeneity(own, [r.session for r in self.runs], alpha, rng, one))

    def diagnosis(self, same: tuple[Homogeneity, ...]) -> Diagnosis:
        """Return the diagnosis but for what only the caller knows."""
        units, split = self.runs[0].units, self.split
        base = self.drive(self.base, self.selection.rounds[0])
        drive = base if self.model is self.base else self.drive(self.model, self.selection.rounds[-1])
        base, drive = base.replace(name="base model"), drive.replace(name="diagnosed drive")
        forces = list(self.pool.map(lambda r: missing_force(base.values, r), self.runs))
        maps = draw_maps(forces)
        findings = self.findings(drive)
        nameless = unnamed(self.bench, self.selection, named=bool(findings))
        estimation = recording_fits(base, drive, self.runs, "estimation", self.runs, self.pool)
        everything = (*self.runs, *split.report)
        report = recording_fits(base, drive, split.report, "report", everything, self.pool)
        loops = loop_fits(base, drive, split.loops, self.pool)
        before, after, floor = total(report) if report else total(estimation)
        tied = fit_tied(self.bench, self.base) if self.topology.two_carts else None
        return in_units(
            Diagnosis(
                verdict=_verdict(findings, nameless, estimation, ended=self.selection.ended),
                faults=(),
                located=located([m.of_rig(units) for m in maps]),
                findings=findings,
                unnamed=nameless,
                handout_tied_rms=float("nan") if tied is None else velocity_rms(self.runs, tied.values, self.pool),
                free_rms=total(estimation)[0],
                ratios=ratios(base),
                before_rms=before,
                after_rms=after,
                floor_rms=floor,
                per_recording=(*estimation, *report, *loops),
                homogeneity=same,
                drive=drive,
                base=base,
                seconds=0.0,
                p_value=significance_of(self.selection.rounds[0]),
                split=replace(split, estimation=tuple(self.runs)),
                detection_limits=self.detection_limits(findings),
                notes=notes_of(drive, split, loops, self.bench.runs, units, self.selection),
                maps=tuple(maps),
                harmonics=tuple(harmonics(forces, self.runs)),
                forces=tuple(forces),
                tied=tied,
                ended=self.selection.ended,
            ),
            units,
        )

    def detection_limits(self, findings: Sequence[Finding]) -> tuple[DetectionLimit, ...]:
        """Return below which size what is not named is not seen; nothing where unknown forces may hide anything."""
        limits = () if self.selection.hiding else self.selection.rounds[-1].detection_limits
        return tuple(x for x in limits if x.name not in {f.name for f in findings})

    def drive(self, best: Fit, step: Round) -> Drive:
        """Return a fit as a drive with its uncertainty under the noise of a round."""
        values = checked(best.values)
        draws = range(self.bench.settings.draws // 2)
        rows = Simulator(self.bench, best.values, step.noise, step.variability).rows(draws, [self.seed, 2])
        limits, covariance = uncertainty(best, rows)
        return Drive(
            values,
            {k: v for k, v in limits.items() if k in values},
            covariance,
            Provenance(
                "diagnosis",
                tuple(r.name for r in self.runs),
                __version__,
                "by output error to the estimation recordings",
            ),
            run_to_run=friction_run_to_run(values, self.bench.runs, self.pool),
            recorded=recorded_range(self.runs),
        )

    def findings(self, drive: Drive) -> tuple[Finding, ...]:
        """Return the accepted candidates in their order, each from the drive that the one before left."""
        found, before = [], self.base
        for scored, step in self.accepted:
            after = before if scored.fit is None else self._left_by(scored.fit, step, before)
            found.append(self.finding(scored, step, drive, before, after))
            before = after
        return tuple(found)

    def _left_by(self, found: Fit, step: Round, before: Fit) -> Fit:
        """Return the drive that a finding leaves, without what was left out again when later ones had been found."""
        names = [n for n in found.names if n in self.model.names]
        if set(names) == set(self.model.names):
            # the drive that is reported: from another start the same parameters would end elsewhere
            return self.model
        if len(names) < len(found.names):
            values = {k: v for k, v in found.values.items() if k in names or k not in found.names}
            found = fit(self.bench, step.noise, values, names)
        return self._by_output_error(found, before)

    def _by_output_error(self, model: Fit, other: Fit) -> Fit:
        """Return the optimum of the output error of a model with some of what was accepted, held against another."""
        own = [s.candidate for s, _ in self.selection.accepted if isinstance(s.candidate, Candidate)]
        return output_error(self.bench, model, other, candidates=own)

    def finding(self, scored: Scored, step: Round, drive: Drive, before: Fit, after: Fit) -> Finding:
        """Return an accepted candidate with what speaks for it; what is named beside it is no tie."""
        beside = {s.name for s, _ in self.accepted}
        ties = [t for t in step.ties() if t.name not in beside]
        judged = self.split.report or self.runs
        compared = [scored, *(t for t in ties if t.fit is not None)]
        return Finding(
            *scored.name,
            _estimates(scored, drive),
            tuple(Named(*t.name) for t in ties),
            experiment_for(scored.name[0]) if ties else None,
            share_of(scored, step),
            significance_of(step),
            velocity_rms(judged, before.values, self.pool),
            velocity_rms(judged, after.values, self.pool),
            keys=scored.candidate.keys if isinstance(scored.candidate, Candidate) else (),
            drives=tuple(
                Drive(checked(s.fit.values), name="@".join(s.name))
                for s in compared
                if scored.fit is not None and s.fit is not None
            ),
        )


def significance_of(step: Round) -> float:
    """Return the p-value of a round: that of its most significant candidate, each compared with the best of the catalogue.

    What is named may be another that predicts as well with fewer parameters.
    """
    return min(s.p for s in step.scored)


def _estimates(scored: Scored, drive: Drive) -> dict[str, Estimate]:
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
    limits = drive.intervals
    return {short(k): Estimate(drive[k], limits.get(k, (drive[k], drive[k])), unit_of(k)) for k in candidate.keys}


def _of_no_size(scored: Scored, model: Fit) -> bool:
    """Whether an effect has come to nothing in a model."""
    candidate = scored.candidate
    return isinstance(candidate, Candidate) and all(model.values[k] == parameter(k).null for k, _ in candidate.sizes)


def _verdict(
    findings: Sequence[Finding], nameless: Unnamed | None, fits: Sequence[RecordingFit], *, ended: bool
) -> Verdict:
    """Return the verdict, which report recordings have no part in."""
    if not findings:
        return "no_mismatch" if nameless is None else "unexplained"
    _, after, floor = total(fits)
    near = not np.isfinite(floor) or after < _NEAR_FLOOR * floor
    return "explained" if nameless is None and near and ended else "partly_explained"
