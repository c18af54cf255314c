"""Which findings stand: on recordings that the search never saw, and by how alike their sizes are in all recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from flexdrive_gym import Drive, Provenance, __version__
from flexdrive_gym.recording import FloatArray, Recording
from identification.methods import rig_parameters
from identification.mismatch.certainty import between_runs, differs, foretold, is_there, students_t, uncertainty
from identification.mismatch.comes_again import KeptAway
from identification.mismatch.crew import Crew
from identification.mismatch.proof import LEARNT, LEARNT_PLAINLY, Proof
from identification.mismatch.prove import place, plain_ratio, polished, removed_from, total, velocity_fits
from identification.mismatch.refit import Coordinates, refit, sensitivities
from identification.mismatch.rounds import Progress
from identification.mismatch.search import Search, Step
from identification.mismatch.settle import absorb, settle
from identification.mismatch.split import Split
from identification.mismatch.workbench import Workbench
from identification.replay.output_error import prepare
from identification.topology import Topology

# how seldom chance may make the size of a finding, where it is seen
_SIZED = 0.01
# of what effects can explain among comparable residuals, a plain fit must keep this share
_KEPT = 0.7
# how often the rest is refitted before that is asked again
_ITERATIONS = (0, 1, 2)


_Drive = Mapping[str, float]
# the effects and places of some findings
_Names = frozenset[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class Compared:
    """A drive fitted where residuals are compared.

    Attributes
    ----------
    drive
        Its parameters.
    cost
        Squared error of the recordings learnt from.
    foretold : ndarray, shape (runs,)
        That of every recording, when the others foretell it.
    sizes
        The same drive with intervals, by leaving out one recording at a time.
    """

    drive: _Drive
    cost: float
    foretold: FloatArray
    sizes: Drive


@dataclass(frozen=True, eq=False)
class Judges:
    """Where drives are compared, and what was fitted there.

    Attributes
    ----------
    bench
        Of the recordings learnt from, around one model; ``None`` where there is one view only.
    fitted
        Findings to the drive with them.
    compared
        Findings to the drive fitted where residuals are compared.
    small
        Findings to whether their effects are too small for a plain fit.
    """

    bench: Workbench | None
    fitted: dict[_Names, Mapping[str, float]] = field(default_factory=dict)
    compared: dict[_Names, Compared] = field(default_factory=dict)
    small: dict[_Names, bool] = field(default_factory=dict)


class Proving:
    """Findings on trial.

    Parameters
    ----------
    free
        The free fit's parameters.
    searched
        The workbench of the search.
    """

    def __init__(
        self,
        runs: Sequence[Recording],
        split: Split,
        topology: Topology,
        free: Mapping[str, float],
        searched: Workbench,
        pool: Crew,
        say: Progress,
    ) -> None:
        self.runs, self.split, self.topology, self.names = runs, split, topology, topology.free
        self.free, self.pool, self.say = free, pool, say
        self.searched = searched
        self.bench = Workbench(searched.runs, pool, parts=split.parts)
        # parts of one recording share its friction and track
        self.kept_away = KeptAway(split.prove, pool) if split.prove and not split.parts else None
        # what was on trial next to no other, and does not stand
        self.refused: list[Proof] = []

    def fitted(self, steps: Sequence[Step], start: Mapping[str, float], judges: Judges) -> Mapping[str, float]:
        """Return the drive with these findings, fitted to what was learnt from; ``start`` has at least their parameters.

        Everything is fitted plainly, if the effects so keep what they explain where residuals are compared. What is small among
        plain residuals does not: such effects keep the sizes of the fit among comparable ones.
        """
        names = _names(steps)
        if names in judges.fitted:
            return judges.fitted[names]
        keys = [k for s in steps for k in keys_of(s)]
        kept, self.bench.offsets = self.bench.offsets, self._offsets(steps)
        seen = start if judges.bench is None else self.compared(judges, steps, start).drive
        # what a drive has next to an effect may be far from what it has without
        begin = min((self._begin(steps, seen, own) for own in (seen, self.free)), key=self._error)
        values = polished(self.bench, begin, [*self.names, *keys])
        lost = judges.bench is not None and bool(keys) and self._lost(judges, steps, start, values)
        if lost:
            values = polished(self.bench, begin, self.names)
        self.bench.offsets = kept
        judges.small[names], judges.fitted[names] = lost, values
        return values

    def _fit(self, many: Sequence[Sequence[Step]], start: Mapping[str, float], judges: Judges) -> None:
        """Fit the drives with each of some sets of findings side by side, for :meth:`compared` and :meth:`fitted` to find."""

        def apart() -> tuple[Proving, Judges]:
            other, bench = copy(self), judges.bench
            other.bench = self.bench.alone()
            return other, replace(judges, bench=None if bench is None else bench.alone())

        def compare(steps: Sequence[Step]) -> None:
            other, own = apart()
            other.compared(own, steps, start)

        def fit(steps: Sequence[Step]) -> None:
            other, own = apart()
            other.fitted(steps, start, own)

        if judges.bench is not None:
            sets = {_names(steps): steps for steps in ((), *many)}
            list(self.pool.map(compare, [steps for names, steps in sets.items() if names not in judges.compared]))
        sets = {_names(steps): steps for steps in many}
        list(self.pool.map(fit, [steps for names, steps in sets.items() if names not in judges.fitted]))

    def _lost(
        self, judges: Judges, steps: Sequence[Step], start: Mapping[str, float], values: Mapping[str, float]
    ) -> bool:
        """Whether effects with the sizes of a plain fit explain less than they can, by more than a share."""
        assert judges.bench is not None
        bare, best = self.compared(judges, (), self.free).cost, self.compared(judges, steps, start).cost
        for iterations in _ITERATIONS:
            if iterations:
                values = refit(judges.bench, values, self.names, iterations=iterations, view="comparable").values
            # a better fit of the rest only adds to what they explain
            if bare - _cost(judges.bench, values) >= _KEPT * (bare - best):
                return False
        return True

    def _begin(self, steps: Sequence[Step], start: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """Return a drive with effects as in ``start`` and everything else as in ``own``."""
        keys = [k for s in steps for k in (*keys_of(s), *held_of(s))]
        base = {k: own.get(k, self.free.get(k, 0.0)) for k in self.names}
        return {**self.topology.fixed, **base, **{k: start[k] for k in keys}}

    def _offsets(self, steps: Sequence[Step]) -> FloatArray:
        offsets = np.zeros(len(self.bench.runs))
        for step in steps:
            if step.rival.candidate.period is not None:
                offsets = step.rival.offsets
        return offsets

    def _error(self, values: Mapping[str, float]) -> float:
        return float(np.sum((self.bench.residual(values) * self.bench.rows.valid) ** 2))

    def certain(
        self, found: Search, steps: Sequence[Step]
    ) -> tuple[list[Proof], Mapping[str, float], Mapping[str, float], Drive]:
        """Return what :meth:`proven` does of the findings whose sizes differ from none, and the drive of all recordings.

        An effect that is there has much the same size in every recording; one that fits a chance of some has not, and its
        interval, from the spread between recordings, holds its absence. Nor does the interval of a shape reach its lower bound.
        The finding that explains most, and others that are plain (:meth:`Proof.plain_beside`), are asked by the scores of the
        recordings; the rest by leaving one recording out at a time.
        """
        judges = self.judges(found.model.values) if steps else Judges(None)
        while True:
            proofs, free, everything = self.proven(found, steps, judges)
            self.say("fitting all recordings")
            steps = [p.step for p in proofs]
            drive, lenient = self.final(everything, steps, small=judges.small.get(_names(steps), False))
            # what the law of the first name lacks is often taken for a second effect: a small one must be the more certain
            first = max(proofs, key=lambda p: p.share, default=None)
            steps = [
                p.step
                for p in proofs
                if is_there(
                    p.step.rival.candidate,
                    lenient if p is first or p.plain_beside else drive,
                    certain=p.sized or ((p is first or p.plain_beside) and self._sized(p.step, steps, judges)),
                )
            ]
            if len(steps) == len(proofs):
                return proofs, free, everything, drive
            if len(proofs) == 1:
                self.refused += proofs

    def _sized(self, step: Step, steps: Sequence[Step], judges: Judges) -> bool:
        """Whether a finding's sizes differ from none where it was seen, among comparable residuals."""
        if judges.bench is None or step.view == "weighted":
            return False
        return differs(step.rival.candidate, judges.compared[_names(steps)].sizes, _SIZED)

    def proven(
        self, found: Search, steps: Sequence[Step], judges: Judges
    ) -> tuple[list[Proof], Mapping[str, float], Mapping[str, float]]:
        """Return those of the findings that hold on recordings kept away, the free drive and the diagnosed one.

        A finding holds if the drive with all findings predicts those recordings better than the drive refitted without it.
        What the law of the largest lacks is often taken for a second effect: recordings kept away must show the others, too.
        """
        free, start = self.fitted((), self.free, judges), found.model.values
        steps = list(steps)
        while True:
            self._fit([steps, *([s for s in steps if s is not step] for step in steps)], start, judges)
            proofs = [self.proof(step, [s for s in steps if s is not step], start, judges) for step in steps]
            failed = [p for p in proofs if not p.holds]
            if not failed:
                largest = max((p.share for p in proofs), default=0.0)
                proofs = [p if p.share == largest else self._asked(p, steps, start, judges) for p in proofs]
                failed = [p for p in proofs if p.share != largest and not p.beside]
            if not failed:
                return proofs, free, self.fitted(steps, start, judges)
            if len(proofs) == 1:
                self.refused += proofs
            # the one without which recordings kept away are predicted best
            steps.remove(min(failed, key=lambda p: p.before).step)

    def stands(self, steps: Sequence[Step], step: Step, start: Mapping[str, float]) -> bool:
        """Return whether a finding of the search holds next to those before it, in the round in which it was made."""
        bench = self.searched
        here, bench.offsets = bench.offsets, self._offsets([*steps, step])
        judges = Judges(None if bench.parts else bench)
        proof = self.proof(step, steps, start, judges)
        beside = proof.holds and any(s.rival.gain > step.rival.gain for s in steps)
        if beside:
            proof = self._asked(proof, [*steps, step], start, judges)
        bench.offsets = here
        if not (proof.holds or step.suspected or steps):
            self.refused.append(proof)
        return proof.holds and (proof.beside or not beside)

    def judges(self, values: Mapping[str, float]) -> Judges:
        """Return where drives are compared, around a drive."""
        if self.bench.parts:
            return Judges(None)
        bench = Workbench(self.bench.runs, self.pool)
        bench.offsets, bench.known = place(values, self.split.learn, self.pool), self.searched.known
        settle(bench, values, self.names)
        return Judges(bench)

    def compared(self, judges: Judges, steps: Sequence[Step], start: Mapping[str, float]) -> Compared:
        """Return a drive fitted where residuals are compared: what is small is not found by a plain fit."""
        names, bench = _names(steps), judges.bench
        assert bench is not None
        if names not in judges.compared:
            begins = [self._begin(steps, start, own) for own in (start, self.free)]
            begin = min(begins, key=lambda values: _cost(bench, values))
            keys = [k for s in steps for k in keys_of(s)]
            fit = refit(bench, begin, [*self.names, *keys], iterations=4, view="comparable")
            e = bench.comparable(bench.residual(fit.values))
            covariance = between_runs(bench, fit.jacobian, e, left_out=True)
            intervals, found = uncertainty(Coordinates(fit.names, begin), fit.values, covariance, len(bench.runs))
            whence = Provenance("compared", tuple(run.name for run in bench.runs), __version__)
            sizes = Drive(fit.values, intervals, found, whence)
            judges.compared[names] = Compared(fit.values, float(e @ e), foretold(bench, fit.jacobian, e), sizes)
        return judges.compared[names]

    def proof(self, step: Step, others: Sequence[Step], start: Mapping[str, float], judges: Judges) -> Proof:
        """Return what a finding removes next to others: the drive fitted without it against that with it."""
        both = (others, [*others, step])
        self._fit(both, start, judges)
        without, everything = (self.fitted(some, start, judges) for some in both)
        kept = self.split.prove or self.split.learn
        before, after, _ = total(velocity_fits(without, everything, kept, self.runs, self.pool, held_out=True))
        low, high, _ = total(velocity_fits(without, everything, self.split.learn, self.runs, self.pool, held_out=False))
        spread, steady = self.searched.spread.get("friction", 0.0), 0.0
        if judges.bench is None or step.view == "weighted":
            learnt = self._removed(self.split.learn, (without, everything), step, 0.0)
        else:
            bare, whole = (self.compared(judges, some, start) for some in both)
            learnt, steady = 1.0 - whole.cost / bare.cost, students_t(bare.foretold - whole.foretold)
        seen = (self._seen(step, others, start, judges), self._seen(step, both[1], start, judges))
        proven = self._removed(kept, seen, step, spread)
        parts = self.split.parts
        ratio = plain_ratio(kept, without, everything, self.pool, parts=parts, spread=0.0 if parts else spread)
        share = max(1.0 - (high / low) ** 2, learnt)
        least = LEARNT_PLAINLY if judges.bench is None else LEARNT
        proof = Proof(step, before, after, share, learnt, proven, ratio, least, steady)
        return self._asked(proof, both[1], start, judges) if proof.open else proof

    def _asked(self, proof: Proof, steps: Sequence[Step], start: Mapping[str, float], judges: Judges) -> Proof:
        """Return a finding, one of some, with how much of what it foretells recordings kept away show."""
        if judges.bench is None or self.kept_away is None or proof.again:
            return proof
        step, others = proof.step, [s for s in steps if s is not proof.step]
        without, everything = (self._seen(step, some, start, judges) for some in (others, steps))
        names = [*self.names, *(k for s in others for k in keys_of(s))]
        return replace(proof, again=self.kept_away.comes_again(without, everything, names))

    def _seen(self, step: Step, steps: Sequence[Step], start: Mapping[str, float], judges: Judges) -> _Drive:
        """Return the drive with some findings, fitted where one of them is seen."""
        if judges.bench is None or step.view == "weighted":
            return self.fitted(steps, start, judges)
        return self.compared(judges, steps, start).drive

    def _removed(
        self, recordings: Sequence[Recording], drives: tuple[_Drive, _Drive], step: Step, spread: float
    ) -> float:
        parts = self.split.parts
        own = 0.0 if parts else spread
        return removed_from(recordings, *drives, self.pool, parts=parts, view=step.view, spread=own)

    def final(self, values: Mapping[str, float], steps: Sequence[Step], *, small: bool) -> tuple[Drive, Drive]:
        """Return the drive fitted to all open-loop recordings, with intervals by leaving one out at a time, and by scores alone.

        ``small`` effects are fitted where they are seen, and the drive with them.
        """
        runs = (*self.split.learn, *self.split.prove)
        bench = Workbench([prepare(r) for r in runs], self.pool)
        bench.offsets = place(values, runs, self.pool)
        names = [*self.names, *(k for s in steps for k in keys_of(s))]
        if small:
            absorb(bench, values)
            values = refit(bench, values, names, iterations=5, view="comparable").values
        else:
            values = polished(bench, values, names)
        c = Coordinates(names, values)
        raw = bench.residual(values)
        e = bench.comparable(raw)
        J = bench.comparable(sensitivities(bench, c, c.of(values), values, raw))
        rig = {k: v for k, v in rig_parameters(self.runs).items() if k not in values}
        whence = Provenance(
            "diagnosis", tuple(r.name for r in runs), __version__, "; ".join(s.rival.name[0] for s in steps)
        )

        def drive(covariance: FloatArray) -> Drive:
            intervals, found = uncertainty(c, values, covariance, len(runs))
            return Drive({**rig, **values}, intervals, found, whence, name="diagnosed drive")

        return drive(between_runs(bench, J, e, left_out=True)), drive(between_runs(bench, J, e, left_out=False))


def _names(steps: Sequence[Step]) -> _Names:
    return frozenset(s.rival.name for s in steps)


def _cost(bench: Workbench, values: Mapping[str, float]) -> float:
    """Return the comparable squared error of a drive."""
    return float(np.sum(bench.comparable(bench.residual(values)) ** 2))


def keys_of(step: Step) -> tuple[str, ...]:
    """Return the parameters of an effect that were fitted."""
    return tuple(k for k in step.rival.candidate.keys if k in step.rival.fit.names)


def held_of(step: Step) -> dict[str, float]:
    """Return the parameters of an effect that were not fitted, because it is there or it is not."""
    fit = step.rival.fit
    if keys_of(step):
        return {}
    return {k: fit.values[k] for k in step.rival.candidate.keys if k in fit.values}
