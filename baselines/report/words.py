"""A diagnosis in plain words, shared by the page and the command."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from baselines.lab.prediction_names import prediction_name
from flexdrive_gym.drive.effects import EFFECTS
from identification.mismatch.answer.finding import Finding, Unnamed, percent
from identification.mismatch.answer.verdict import Diagnosis, Interval, Prediction, RecordingFit
from identification.mismatch.candidates.free import followed
from identification.quantities import HANDOUT_RATIOS

_GREEK = {"alpha": "α = m2/m1", "beta": "β = b2/b1", "gamma": "γ = d2/d1"}
# an error that rises by less is within what differs between runs
_WORSE = 1.05
_PROPER = {"stribeck": "Stribeck effect"}


def effect_name(id_: str) -> str:
    """Return an effect's name in words."""
    return _PROPER.get(id_, id_.replace("_", " "))


def at(id_: str, where: str) -> str:
    """Return "effect at place", or what a force that has no name follows."""
    follows = followed(id_)
    if follows is None:
        return f"{effect_name(id_)} at {where.replace('_', ' ')}"
    return f"{_something(where)} that follows {follows}"


def _something(where: str) -> str:
    """Return what acts at a place: a force only where one can."""
    if where == "spring":
        return "a force in the spring"
    return f"{'a force on' if where.startswith('cart') else 'something at'} {where.replace('_', ' ')}"


def by_number(name: str) -> list[tuple[float, str]]:
    """Return a key that sorts names by the numbers in them: 2.5 Hz before 12 Hz."""
    pieces = re.split(r"(\d+(?:\.\d+)?)", name)
    return [(float(p), "") if i % 2 else (-1.0, p) for i, p in enumerate(pieces)]


def listed(items: Iterable[str], last: str = "and") -> str:
    """Return "a, b and c"."""
    parts = list(items)
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def equation(id_: str) -> str:
    """Return the law of an effect."""
    return next((e.equation for e in EFFECTS if e.id == id_), "")


def rms(value: float) -> str:
    """Return an rms for a sentence."""
    return f"{value:.3g}" if math.isfinite(value) else "unknown"


def where_reported(d: Diagnosis) -> str:
    """Return on which recordings the errors before and after were taken."""
    if d.split.report:
        return "on report recordings"
    return "on the recordings it was fitted to (too few to keep any for the report)"


def within_reach(d: Diagnosis) -> float:
    """Return the share of the squared error above the floor that the naming removed; nan where unknown."""
    above = d.before_rms**2 - d.floor_rms**2
    # not every recording repeats itself, so the floor may be that of the louder ones
    return min(1.0, (d.before_rms**2 - d.after_rms**2) / above) if above > 0.0 else float("nan")


def without_name(u: Unnamed) -> str:
    """Return where an effect without a name acts, and like what."""
    return f"{_something(u.where)} {u.acts_on}"


def verdict_sentences(d: Diagnosis) -> list[str]:
    """Return the verdict in one to four plain sentences."""
    floor = (
        f" The floor, what differs between repetitions and so cannot be explained by a model, is {rms(d.floor_rms)} {d.unit}."
        if math.isfinite(d.floor_rms)
        else ""
    )
    way = "falls" if d.after_rms < d.before_rms else "rises"
    change = f"The rms error {where_reported(d)} {way} from {rms(d.before_rms)} to {rms(d.after_rms)} {d.unit}.{floor}"
    leaves = f"The base model with free ratios leaves {rms(d.before_rms)} {d.unit} rms {where_reported(d)}.{floor}"
    unnamed = ""
    if d.unnamed is not None:
        unnamed = (
            f"{percent(d.unnamed.share_of_error).capitalize()} of the remaining squared error has no name in the catalogue: "
            f"{without_name(d.unnamed)}."
        )
    if d.verdict == "no_mismatch":
        return ["No left-out physics is needed: no effect of the catalogue is significant.", leaves]
    if d.verdict == "unexplained":
        first = "The model lacks something that no effect of the catalogue describes."
        return [first, *([unnamed] if unnamed else []), leaves]
    if d.verdict == "explained":
        more = ""
    elif d.unnamed is not None:
        more = ", and something more that no effect of the catalogue describes"
    elif not d.ended:
        more = ". The search came to the most rounds that it may have, so more may be left out"
    else:
        more = ". The error stays above the floor, but nothing more is significant"
    names = listed(at(f.id, f.where) for f in d.findings)
    return [f"The model left out: {names}{more}.", change, *worse_sentences(d), *([unnamed] if unnamed else [])]


def worsened(d: Diagnosis) -> list[RecordingFit]:
    """Return the recordings, report ones where there are, whose error rose by more than 5 % with the named physics."""
    if not d.findings:
        return []
    fits = [f for f in d.per_recording if math.isfinite(f.before_rms + f.after_rms) and f.before_rms > 0.0]
    asked = [f for f in fits if f.part == "report"] or fits
    worse = [f for f in asked if f.after_rms > _WORSE * f.before_rms]
    return sorted(worse, key=lambda f: f.before_rms / f.after_rms)


def worse_sentences(d: Diagnosis) -> list[str]:
    """Say which recordings the named physics describes worse than the base model does; empty where none."""
    worse = worsened(d)
    if not worse:
        return []
    report = [f for f in d.per_recording if f.part == "report"]
    kind = "report recordings" if report else "recordings"
    shown = listed(f"{f.recording} ({rms(f.before_rms)} → {rms(f.after_rms)} {f.unit})" for f in worse)
    return [f"{len(worse)} of {len(report or d.per_recording)} {kind} got worse: {shown}."]


def figure(value: float | None) -> str:
    """Return a predicted figure for a table; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def interval(p: Interval) -> str:
    """Return a predicted figure with its 95 % interval."""
    if p.ci95 is None or p.ci95 == (None, None):
        return figure(p.value)
    low, high = ("no limit" if x is None else f"{x:.4g}" for x in p.ci95)
    return f"{figure(p.value)} [{low}, {high}]"


def extrapolation_sentences(d: Diagnosis) -> list[str]:
    """Return why predictions leave what was recorded, one sentence for each reason."""
    by: dict[str, list[str]] = {}
    for p in d.predictions:
        if p.extrapolated is not None:
            by.setdefault(p.extrapolated, []).append(prediction_name(p.name, d.drive.units))
    return [f"Extrapolated: {listed(names)}. {why}" for why, names in by.items()]


def telling_prediction(d: Diagnosis) -> Prediction | None:
    """Return the prediction that the rig answered, else the one that the naming changes most."""
    known = [p for p in d.predictions if p.before.value and p.after.value]
    answered = [p for p in known if "grew" in p.measured]
    return max(answered or known, key=_change, default=None)


def _change(p: Prediction) -> float:
    return abs(math.log(abs((p.after.value or 1.0) / (p.before.value or 1.0))))


def homogeneity_sentence(d: Diagnosis) -> str:
    """Say whether the parameters are the same in all recordings and sessions."""
    if not d.homogeneity:
        return (
            "Not asked: the recordings are of one session, or a session has too few of them for estimates of its own."
        )
    changed = [h for h in d.homogeneity if "changed" in h.statement]
    if not changed:
        return "All parameters are the same within their uncertainty."
    return f"{listed(h.parameter for h in changed)} changed; the others are the same within their uncertainty."


def tie_sentences(f: Finding) -> list[str]:
    """Return what the recordings cannot tell a finding from, and the experiment that would; empty without ties."""
    if not f.ties:
        return []
    text = f"These recordings cannot tell {at(f.id, f.where)} from {listed((at(t.id, t.where) for t in f.ties), 'or')}."
    if f.separating_experiment:
        text += f" To separate them, record {f.separating_experiment}."
    return [text]


def ratio_sentences(d: Diagnosis) -> list[str]:
    """Say whether the handout's ratios hold."""
    if not d.ratios:
        return []
    held: list[str] = []
    broken: list[str] = []
    for name, assumed in HANDOUT_RATIOS.items():
        q = d.ratios[name]
        bounds = "" if q.ci95 is None else f" [{q.ci95[0]:.3g}, {q.ci95[1]:.3g}]"
        text = f"{_GREEK[name]} = {q.value:.3g}{bounds} (handout {assumed:g})"
        fits = q.ci95 is not None and q.ci95[0] <= assumed <= q.ci95[1]
        (held if fits else broken).append(text)
    lines = []
    if broken:
        lines.append(f"The handout's ratios do not hold here: {listed(broken)}.")
    if held:
        lines.append(f"{'Within its interval' if len(held) == 1 else 'Within their intervals'}: {listed(held)}.")
    if math.isfinite(d.handout_tied_rms) and d.handout_tied_rms > 0.0:
        cut = 1.0 - (d.free_rms / d.handout_tied_rms) ** 2
        lines.append(
            f"With the handout's ratios held, the fit leaves {rms(d.handout_tied_rms)} {d.unit} rms; free, "
            f"{rms(d.free_rms)}: freeing them alone removes {cut:.0%} of the squared error, before any physics is added."
        )
    return lines
