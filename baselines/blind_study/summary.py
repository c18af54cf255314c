"""The figures of a study: hit rates, false positives, detection limits, and errors of parameters and predictions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite, log

import numpy as np
from scipy.optimize import minimize

from baselines.blind_study.judge import Concealed, Judged, Known
from baselines.evaluation.proportions import Share, share

DRIVES = ("tied", "free", "diagnosed")
_HALF = 0.5


@dataclass(frozen=True)
class Detection:
    """From which size on an effect is named, exactly or in a tie.

    Attributes
    ----------
    name
        Id of the effect.
    by_size
        Size to the number named and the number of trials.
    half, nine_tenths
        Sizes that are named in 50 % and in 90 % of trials, by a logistic curve in the logarithm of size whose slope all
        effects share; a limit outside the sizes tried is an extrapolation.
    """

    name: str
    by_size: Mapping[float, tuple[int, int]]
    half: float
    nine_tenths: float


@dataclass(frozen=True)
class Accuracy:
    """Relative error of a parameter over trials: median of its magnitude, and how often the 95 % interval held the truth."""

    name: str
    median_error: float
    inside: Share


@dataclass(frozen=True)
class Summary:
    """A study in figures; shares are ``None`` where no trial tells of them.

    Attributes
    ----------
    trials, failed
        Judged ones; diagnoses that ended in an error.
    named, exact
        Of single effects at half the plainly present size and above: named exactly or in a tie; exactly.
    by_size
        Size to the share named (exactly or in a tie), of single effects.
    pairs_both, pairs_one
        Pairs of which both, and at least one, were named.
    outside_unnamed, outside_silent, outside_misnamed
        Effects outside the catalogue: reported as unnamed and nothing named; nothing said; some name given.
    null_names, null_alarms
        Of trials that conceal nothing at all: a name was given; a name or an unnamed effect was reported.
    false_names
        Of all trials: at least one false positive, a name of something that is not concealed.
    faults, false_faults
        Broken encoders found; trials with a fault reported where there is none.
    over_floor
        Median of held-out rms over floor, before and after, where an effect was concealed.
    null_over_floor
        The same where nothing was: what nuisance alone makes, which no name can explain.
    gain_error
        Drive to the median relative error of its predicted critical gain, in trials that conceal an effect or an outsider.
    base, effects
        Accuracy of parameters.
    null_inside
        Of m1 … d2 on nulls: within their 95 % intervals.
    detection
        By effect.
    confusion
        What was concealed ("nothing" for nulls) to what was said of it, and how often.
    seconds
        Median and largest time of a diagnosis [s].
    """

    trials: int
    failed: int
    named: Share | None
    exact: Share | None
    by_size: Mapping[float, Share]
    pairs_both: Share | None
    pairs_one: Share | None
    outside_unnamed: Share | None
    outside_silent: Share | None
    outside_misnamed: Share | None
    null_names: Share | None
    null_alarms: Share | None
    false_names: Share | None
    faults: Share | None
    false_faults: Share | None
    over_floor: tuple[float, float]
    null_over_floor: float
    gain_error: Mapping[str, float]
    base: tuple[Accuracy, ...]
    effects: tuple[Accuracy, ...]
    null_inside: Share | None
    detection: tuple[Detection, ...]
    confusion: Mapping[str, Mapping[str, int]]
    seconds: tuple[float, float]


def summarise(trials: Sequence[Judged]) -> Summary:
    """Return the figures of judged trials."""
    single = [t.concealed[0] for t in trials if len(t.concealed) == 1 and t.kind == "effect"]
    plain = [c for c in single if c.size >= _HALF]
    pairs = [t for t in trials if len(t.concealed) > 1]
    outside = [t for t in trials if t.outside is not None]
    nulls = [t for t in trials if t.nothing and t.kind == "null"]
    physics = [t for t in trials if not t.nothing and not t.failed]
    return Summary(
        trials=len(trials),
        failed=sum(t.failed is not None for t in trials),
        named=share([c.named != "missed" for c in plain]),
        exact=share([c.named == "exact" for c in plain]),
        by_size={
            s: found
            for s in sorted({c.size for c in single})
            if (found := share([c.named != "missed" for c in single if c.size == s])) is not None
        },
        pairs_both=share([all(c.named != "missed" for c in t.concealed) for t in pairs]),
        pairs_one=share([any(c.named != "missed" for c in t.concealed) for t in pairs]),
        outside_unnamed=share([t.unnamed and not t.findings for t in outside]),
        outside_silent=share([not t.unnamed and not t.findings for t in outside]),
        outside_misnamed=share([bool(t.findings) for t in outside]),
        null_names=share([bool(t.findings) for t in nulls]),
        null_alarms=share([bool(t.findings) or t.unnamed for t in nulls]),
        false_names=share([bool(t.false_names) for t in trials]),
        faults=share([i < t.faults_found for t in trials for i in range(t.faults)]),
        false_faults=share([t.false_faults > 0 for t in trials]),
        over_floor=(_median([t.before / t.floor for t in physics]), _median([t.after / t.floor for t in physics])),
        null_over_floor=_median([t.before / t.floor for t in trials if t.nothing and not t.failed]),
        gain_error={drive: _median_gain_error(physics, drive) for drive in DRIVES},
        base=_accuracy([k for t in trials for k in t.base]),
        effects=_accuracy([k for t in trials for k in t.effects]),
        null_inside=share([k.inside for t in nulls for k in t.base]),
        detection=_detection(single),
        confusion=_confusion(trials),
        seconds=(_median([t.seconds for t in trials]), max((t.seconds for t in trials), default=float("nan"))),
    )


def _median(values: Sequence[float]) -> float:
    finite = [v for v in values if isfinite(v)]
    return float(np.median(finite)) if finite else float("nan")


def _gain_error(trial: Judged, drive: str) -> float | None:
    """Return by which share a drive's critical gain is off: inf where it knows none, ``None`` where there is nothing to know."""
    if trial.predicted is None or trial.critical_gain is None:
        return None
    predicted = trial.predicted.get(drive)
    return float("inf") if predicted is None else abs(predicted / trial.critical_gain - 1.0)


def _median_gain_error(trials: Sequence[Judged], drive: str) -> float:
    errors = [e for t in trials if (e := _gain_error(t, drive)) is not None]
    return float(np.median(errors)) if errors else float("nan")


def _accuracy(known: Sequence[Known]) -> tuple[Accuracy, ...]:
    found = []
    for name in dict.fromkeys(k.name for k in known):
        own = [k for k in known if k.name == name]
        inside = share([k.inside for k in own])
        assert inside is not None
        # a sign that depends on how the rig is looked at is no error of the size
        found.append(Accuracy(name, _median([abs(k.error) for k in own]), inside))
    return tuple(found)


def _detection(single: Sequence[Concealed]) -> tuple[Detection, ...]:
    """Fit the logistic curves by penalised likelihood: one slope, one position per effect, shrunk towards their mean."""
    ids = sorted({c.id for c in single})
    if len(single) < 2:
        return ()
    size = np.log([c.size for c in single])
    named = np.array([c.named != "missed" for c in single])
    which = np.array([ids.index(c.id) for c in single])

    def cost(z: np.ndarray) -> float:
        slope, mean, own = np.exp(z[0]), z[1], z[2:]
        logit = slope * (size - own[which])
        likelihood = np.sum(np.logaddexp(0.0, np.where(named, -logit, logit)))
        # positions scatter by a factor of e about a common one, itself within a factor e² of size one
        return float(likelihood + np.sum((own - mean) ** 2) / 2.0 + mean**2 / 8.0 + (z[0] - log(2.0)) ** 2 / 2.0)

    best = minimize(cost, np.concatenate(([log(2.0), 0.0], np.zeros(len(ids)))), method="L-BFGS-B").x
    slope = exp(best[0])
    found = []
    for i, name in enumerate(ids):
        own = [c for c in single if c.id == name]
        by_size = {
            s: (sum(c.named != "missed" for c in own if c.size == s), sum(c.size == s for c in own))
            for s in sorted({c.size for c in own})
        }
        half = exp(best[2 + i])
        found.append(Detection(name, by_size, half, half * 9.0 ** (1.0 / slope)))
    return tuple(found)


def _confusion(trials: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Count what was said of every concealed effect: its own name, a tie's, another's, unnamed, or nothing."""
    table: dict[str, Counter[str]] = {}

    def add(true: str, said: str) -> None:
        table.setdefault(true, Counter())[said] += 1

    for t in trials:
        missed = [c.name for c in t.concealed if c.named == "missed"]
        missed += ["nothing"] if t.nothing else [] if t.outside is None else [t.outside]
        for true in missed:
            for said in t.false_names or (("unnamed",) if t.unnamed else ("nothing",)):
                add(true, said)
        for c in t.concealed:
            if c.named != "missed":
                add(c.name, c.name if c.named == "exact" else "in a tie")
    return {true: dict(said.most_common()) for true, said in sorted(table.items())}


Aim = tuple[str, Callable[[Summary], Share | float | str | None], str]


def _value(number: Share | float | str | None) -> str:
    if number is None:
        return "–"
    return f"{number:.3g}" if isinstance(number, float) else str(number)


def _percent(fraction: float) -> str:
    return f"{fraction:.1%}" if isfinite(fraction) else "–"


_AIMS: tuple[Aim, ...] = (
    ("single effects from half size on, named exactly or in a tie", lambda s: s.named, "≥ 92 %"),
    ("single effects from half size on, named exactly", lambda s: s.exact, "≥ 85 %"),
    ("nulls with a name", lambda s: s.null_names, "≤ 2 %"),
    ("nulls with a name or an unnamed effect", lambda s: s.null_alarms, ""),
    ("trials with a false positive", lambda s: s.false_names, "≤ 3 %"),
    ("pairs, both named", lambda s: s.pairs_both, "≥ 80 %"),
    ("pairs, at least one named", lambda s: s.pairs_one, ""),
    ("effects outside the catalogue reported as unnamed", lambda s: s.outside_unnamed, "≥ 80 %"),
    ("effects outside the catalogue given a name", lambda s: s.outside_misnamed, "≤ 8 %"),
    ("effects outside the catalogue not noticed", lambda s: s.outside_silent, ""),
    ("broken encoders found", lambda s: s.faults, "all"),
    ("trials with a fault reported where there is none", lambda s: s.false_faults, ""),
    ("median held-out rms over floor, before naming", lambda s: s.over_floor[0], ""),
    ("median held-out rms over floor, after naming", lambda s: s.over_floor[1], "≤ 1.1"),
    ("median held-out rms over floor where nothing is concealed", lambda s: s.null_over_floor, ""),
    ("median error of the critical gain, handout's tied fit", lambda s: _percent(s.gain_error["tied"]), ""),
    ("median error of the critical gain, free fit", lambda s: _percent(s.gain_error["free"]), ""),
    ("median error of the critical gain, diagnosed drive", lambda s: _percent(s.gain_error["diagnosed"]), "≤ 5 %"),
    ("m1 … d2 of nulls within their 95 % intervals", lambda s: s.null_inside, "95 %"),
    ("seconds per diagnosis on one core, median", lambda s: s.seconds[0], ""),
)


def headline(summary: Summary) -> list[tuple[str, str, str]]:
    """Return the main figures as rows: what, value with its 95 % interval, aim."""
    return [(what, _value(of(summary)), aim) for what, of, aim in _AIMS]


def missed_or_false(trials: Sequence[Judged]) -> list[tuple[str, str, str, str]]:
    """Return the trials in which something is missed or false: number, what was concealed, what was said, what is wrong."""
    return [(str(t.number), t.truth, t.answer, "; ".join(t.wrong)) for t in trials if t.wrong]
