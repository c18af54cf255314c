"""A diagnosis in plain words: what the page and the command say alike."""

from __future__ import annotations

import math
from collections.abc import Iterable

from flexdrive_gym.drive.effects import EFFECTS
from identification.mismatch.verdict import Diagnosis, Finding, Prediction
from identification.quantities import HANDOUT_RATIOS

_GREEK = {"alpha": "α = m2/m1", "beta": "β = b2/b1", "gamma": "γ = d2/d1"}
_PROPER = {"stribeck": "Stribeck effect"}


def effect_name(id_: str) -> str:
    """Return an effect's name in words."""
    return _PROPER.get(id_, id_.replace("_", " "))


def at(id_: str, where: str) -> str:
    """Return "effect at place"."""
    return f"{effect_name(id_)} at {where.replace('_', ' ')}"


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
        return "on recordings kept away from the fit"
    return "on the recordings it was fitted to (too few to keep any away)"


def within_reach(d: Diagnosis) -> float:
    """Return the share of the squared error above the floor that the naming removed; nan where unknown."""
    above = d.before_rms**2 - d.floor_rms**2
    return (d.before_rms**2 - d.after_rms**2) / above if above > 0.0 else float("nan")


def verdict_sentences(d: Diagnosis) -> list[str]:
    """Return the verdict in one to three plain sentences."""
    names = listed(at(f.id, f.where) for f in d.findings) if d.findings else ""
    floor = (
        f"; what does not repeat, and no model can explain, is {rms(d.floor_rms)}" if math.isfinite(d.floor_rms) else ""
    )
    way = "falls" if d.after_rms < d.before_rms else "rises"
    own = ""
    if d.own_rms is not None:
        own = (
            f"; with each run's own dry friction, which differs by about {d.friction_spread:.0%}, it goes from "
            f"{rms(d.own_rms[0])} to {rms(d.own_rms[1])}"
        )
    change = (
        f"The error {where_proven(d)} {way} from {rms(d.before_rms)} to {rms(d.after_rms)} {d.unit} rms{own}{floor}."
    )
    leaves = f"The free fit leaves {rms(d.before_rms)} {d.unit} rms {where_proven(d)}{floor}."
    unnamed = ""
    if d.unnamed is not None:
        unnamed = (
            f"{d.unnamed.share_of_error:.0%} of the remaining squared error has no name in the catalogue: a force on "
            f"{d.unnamed.where.replace('_', ' ')} that follows {d.unnamed.acts_on}."
        )
    if d.verdict == "no_mismatch":
        return ["No left-out physics is needed: nothing in the catalogue explains more than chance could.", leaves]
    if d.verdict == "unexplained":
        return ["Something is missing that has no name in the catalogue.", *([unnamed] if unnamed else []), leaves]
    if d.verdict == "explained":
        more = ""
    elif d.unnamed is not None:
        more = ", and something more that no name explains"
    else:
        more = ", and the error stays above the floor, without a shape that could be told from chance"
    return [f"The model left out: {names}{more}.", change, *([unnamed] if unnamed else [])]


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
