"""A diagnosis in plain words: what the page and the command say alike."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from flexdrive_gym.drive.effects import EFFECTS
from identification.mismatch.verdict import Diagnosis, Finding, Prediction, RecordingFit
from identification.quantities import HANDOUT_RATIOS

_GREEK = {"alpha": "α = m2/m1", "beta": "β = b2/b1", "gamma": "γ = d2/d1"}
# an error that rises by less is within what differs between runs
_WORSE = 1.05
_PROPER = {"stribeck": "Stribeck effect"}


def effect_name(id_: str) -> str:
    """Return an effect's name in words."""
    return _PROPER.get(id_, id_.replace("_", " "))


def at(id_: str, where: str) -> str:
    """Return "effect at place"."""
    return f"{effect_name(id_)} at {where.replace('_', ' ')}"


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


def where_proven(d: Diagnosis) -> str:
    """Return on which recordings the figures of merit were taken."""
    if d.split.prove:
        return "on held-out recordings"
    return "on the recordings it was fitted to (too few to hold any out)"


def within_reach(d: Diagnosis) -> float:
    """Return the share of the squared error above the floor that the naming removed; nan where unknown."""
    above = d.before_rms**2 - d.floor_rms**2
    return (d.before_rms**2 - d.after_rms**2) / above if above > 0.0 else float("nan")


def verdict_sentences(d: Diagnosis) -> list[str]:
    """Return the verdict in one to three plain sentences."""
    names = listed(at(f.id, f.where) for f in d.findings) if d.findings else ""
    floor = (
        f" The floor, what differs between repetitions and so cannot be explained by a model, is {rms(d.floor_rms)} {d.unit}."
        if math.isfinite(d.floor_rms)
        else ""
    )
    way = "falls" if d.after_rms < d.before_rms else "rises"
    own = ""
    if d.own_rms is not None:
        own = (
            f" Dry friction differs by about {d.friction_spread:.0%} between runs; with each run's own friction the error "
            f"changes from {rms(d.own_rms[0])} to {rms(d.own_rms[1])} {d.unit}."
        )
    change = (
        f"The rms error {where_proven(d)} {way} from {rms(d.before_rms)} to {rms(d.after_rms)} {d.unit}.{floor}{own}"
    )
    leaves = f"The fit of the handout's model with free ratios leaves {rms(d.before_rms)} {d.unit} rms {where_proven(d)}.{floor}"
    unnamed = ""
    if d.unnamed is not None:
        unnamed = (
            f"{d.unnamed.share_of_error:.0%} of the remaining squared error has no name in the catalogue: a force on "
            f"{d.unnamed.where.replace('_', ' ')} that follows {d.unnamed.acts_on}."
        )
    if d.verdict == "no_mismatch":
        return [
            "No left-out physics is needed: no effect of the catalogue is significant.",
            leaves,
            *worse_sentences(d),
        ]
    if d.verdict == "unexplained":
        first = "The model lacks something that no effect of the catalogue describes."
        return [first, *([unnamed] if unnamed else []), leaves, *worse_sentences(d)]
    if d.verdict == "explained":
        more = ""
    elif d.unnamed is not None:
        more = ", and something more that no effect of the catalogue describes"
    else:
        more = ". The error stays above the floor, but nothing more is significant"
    return [f"The model left out: {names}{more}.", change, *worse_sentences(d), *([unnamed] if unnamed else [])]


def worsened(d: Diagnosis) -> list[RecordingFit]:
    """Return the recordings, held-out ones where there are, whose error rose by more than 5 % with the named physics."""
    fits = [f for f in d.per_recording if math.isfinite(f.before_rms + f.after_rms) and f.before_rms > 0.0]
    asked = [f for f in fits if f.held_out] or fits
    if not d.findings:
        return []
    worse = [f for f in asked if f.after_rms > _WORSE * f.before_rms]
    return sorted(worse, key=lambda f: f.before_rms / f.after_rms)


def worse_sentences(d: Diagnosis) -> list[str]:
    """Say which recordings the named physics describes worse than the fit without it; empty where none."""
    worse = worsened(d)
    if not worse:
        return []
    held = [f for f in d.per_recording if f.held_out]
    kind = "held-out recordings" if held else "recordings"
    shown = listed(f"{f.recording} ({rms(f.before_rms)} → {rms(f.after_rms)} {f.unit})" for f in worse)
    return [f"{len(worse)} of {len(held or d.per_recording)} {kind} got worse: {shown}."]


def telling_prediction(d: Diagnosis) -> Prediction | None:
    """Return the prediction that the rig answered, else the one that the naming changes most."""
    known = [p for p in d.predictions if p.before and p.after]
    answered = [p for p in known if "grew" in p.measured]
    return max(answered or known, key=lambda p: abs(math.log(abs((p.after or 1.0) / (p.before or 1.0)))), default=None)


def tie_sentences(f: Finding) -> list[str]:
    """Return what the recordings cannot tell a finding from, and the experiment that would; empty without ties."""
    if not f.ties:
        return []
    text = f"These recordings cannot tell {at(f.id, f.where)} from {listed((at(t.id, t.where) for t in f.ties), 'or')}."
    if f.separating_experiment:
        text += f" To tell them apart, record {f.separating_experiment}."
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
