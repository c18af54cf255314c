"""What a diagnosis is worth, now that the seal is open.

A concealed effect counts as named *exactly* if a finding has its id and place, *in a tie* if a finding lists it among what the
recordings cannot tell from it, else as *missed*. A finding that names nothing concealed is a *false name*; it is a false alarm
as well if nothing at all was concealed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, Literal

from flexdrive_gym.drive.toml import loads
from identification.topology import TWO_CARTS

How = Literal["exact", "tie", "missed"]

# a fault is found if what was masked touches it, give or take this
_TOUCH_S = 0.02

# sizes that mean the same to both programs: effect to its name here and there
SAME_SIZES: Mapping[str, tuple[str, str]] = {
    "input_offset": ("u0", "offset"),
    "dead_zone": ("uz", "notch"),
    "input_delay": ("tau", "wait"),
    "amplifier_lag": ("tau", "lag"),
    "gain_asymmetry": ("a", "gain_skew"),
    "encoder_scale": ("s", "scale{cart}"),
    "encoder_delay": ("tau", "late{cart}"),
    "encoder_play": ("g", "play{cart}"),
    "coupling_backlash": ("g", "gap"),
    "load_friction": ("mu", "load{cart}"),
}


@dataclass(frozen=True)
class Concealed:
    """A concealed effect and how it was named."""

    id: str
    where: str
    size: float
    named: How

    @property
    def name(self) -> str:
        """Effect and place."""
        return f"{self.id}@{self.where}"


@dataclass(frozen=True)
class Known:
    """A parameter whose true value means the same in both programs: truth, estimate, whether the interval holds it."""

    name: str
    true: float
    estimate: float
    inside: bool

    @property
    def error(self) -> float:
        """Relative error."""
        return self.estimate / self.true - 1.0


@dataclass(frozen=True)
class Judged:
    """One trial, judged.

    Attributes
    ----------
    number, kind, failed, seconds
        Of the trial; ``failed`` is the error of a diagnosis that ended in one.
    concealed
        The effects of the catalogue that were hidden.
    outside
        Id of the hidden effect that is in nobody's catalogue, or ``None``.
    findings
        All names given, with their places.
    false_names
        Those among them that name nothing concealed.
    unnamed
        Whether physics without a name was reported.
    faults, faults_found, false_faults
        Broken encoders; how many of them were found; faults reported where there is none.
    before, after, floor
        Rms on recordings held out [mm/s].
    critical_gain
        The rig's own, from x2 [V/mm]; ``None`` where there is none below 10.
    predicted
        The critical gains by drive: tied, free, diagnosed [V/mm].
    base, effects
        Parameters of the drive, and of the effects that were named exactly, where truth and estimate can be compared.
    """

    number: int
    kind: str
    failed: str | None
    seconds: float
    concealed: tuple[Concealed, ...] = ()
    outside: str | None = None
    outside_size: float = 0.0
    findings: tuple[str, ...] = ()
    false_names: tuple[str, ...] = ()
    unnamed: bool = False
    faults: int = 0
    faults_found: int = 0
    false_faults: int = 0
    before: float = float("nan")
    after: float = float("nan")
    floor: float = float("nan")
    critical_gain: float | None = None
    predicted: Mapping[str, float | None] | None = None
    base: tuple[Known, ...] = ()
    effects: tuple[Known, ...] = ()

    @property
    def nothing(self) -> bool:
        """Whether no physics was concealed."""
        return not self.concealed and self.outside is None

    @property
    def truth(self) -> str:
        """What was concealed, with its size, in words."""
        hidden = [f"{c.name} × {c.size:g}" for c in self.concealed]
        return "; ".join([*hidden, *([f"{self.outside} × {self.outside_size:g}"] if self.outside else [])]) or "nothing"

    @property
    def answer(self) -> str:
        """What the diagnosis said, in words."""
        names = "; ".join([*self.findings, *(["unnamed"] if self.unnamed else [])])
        tied = "".join(f" ({c.name} in a tie)" for c in self.concealed if c.named == "tie")
        return self.failed or names + tied or "nothing"

    @property
    def wrong(self) -> tuple[str, ...]:
        """What is missed and what is false, in words; empty where all is right."""
        missed = [f"{c.name} missed" for c in self.concealed if c.named == "missed"]
        false = [f"{name} false" for name in self.false_names]
        unnoticed = self.outside is not None and not self.findings and not self.unnamed
        faults = self.faults - self.faults_found
        return (
            *missed,
            *false,
            *([f"{self.outside} not noticed"] if unnoticed else []),
            *(["something unnamed where nothing is concealed"] if self.unnamed and self.nothing else []),
            *([f"{faults} of {self.faults} broken encoders not found"] if faults > 0 else []),
            *(["a fault where there is none"] if self.false_faults else []),
        )


def judge(outcome: Mapping[str, Any]) -> Judged:
    """Return the judgement of one outcome of :func:`baselines.blind_study.one.conduct`."""
    trial, truth, answer = outcome["trial"], outcome["truth"], outcome["answer"]
    hidden = [e for e in truth["effects"] if e["where"] != "outside"]
    strange = next((e for e in truth["effects"] if e["where"] == "outside"), None)
    common: dict[str, Any] = {
        "number": trial["number"],
        "kind": truth["kind"],
        "failed": outcome["failed"],
        "seconds": outcome["seconds"],
        "outside": None if strange is None else strange["id"],
        "outside_size": 0.0 if strange is None else strange["size"],
        "faults": len(truth["faults"]),
        "critical_gain": outcome.get("critical_gain"),
    }
    if answer is None:
        missed = tuple(Concealed(e["id"], e["where"], e["size"], "missed") for e in hidden)
        return Judged(**common, concealed=missed)
    found = answer["diagnosis"]
    names = {(f["id"], f["where"]): {(t["id"], t["where"]) for t in f["ties"]} for f in found["findings"]}
    concealed, matched = [], set()
    for e in hidden:
        name = e["id"], e["where"]
        tied = [n for n, ties in names.items() if name in ties and n not in matched]
        how: How = "exact" if name in names else "tie" if tied else "missed"
        matched |= {name} if how == "exact" else set(tied[:1])
        concealed.append(Concealed(*name, e["size"], how))
    faults = [f for f in found["faults"] if f["id"] != "saturation"]
    return Judged(
        **common,
        concealed=tuple(concealed),
        findings=tuple("@".join(n) for n in names),
        false_names=tuple("@".join(n) for n in names if n not in matched),
        unnamed=found["unnamed"] is not None,
        faults_found=sum(any(_touches(f, t) for f in faults) for t in truth["faults"]),
        false_faults=sum(not any(_touches(f, t) for t in truth["faults"]) for f in faults),
        before=_number(found["fit"]["before_rms"]),
        after=_number(found["fit"]["after_rms"]),
        floor=_number(found["fit"]["floor_rms"]),
        predicted=answer["critical_gains"],
        base=_base(answer["drives"]["diagnosed"], truth["drive"]),
        effects=tuple(
            known
            for e, c in zip(hidden, concealed, strict=True)
            if c.named == "exact"
            for known in _comparable(e, next(f for f in found["findings"] if (f["id"], f["where"]) == (c.id, c.where)))
        ),
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _touches(fault: Mapping[str, Any], true: Mapping[str, Any]) -> bool:
    same = fault["recording"].split(".csv")[0] == true["recording"] and fault["where"] == true["where"]
    return bool(same and fault["start_s"] < true["end_s"] + _TOUCH_S and fault["end_s"] > true["start_s"] - _TOUCH_S)


def _base(text: str, truth: Mapping[str, float]) -> tuple[Known, ...]:
    drive = loads(text)
    found = []
    for name in TWO_CARTS.free:
        low, high = drive.intervals.get(name, (float("nan"), float("nan")))
        found.append(Known(name, truth[name], drive[name], low <= truth[name] <= high))
    return tuple(found)


def _comparable(effect: Mapping[str, Any], finding: Mapping[str, Any]) -> list[Known]:
    """Return the parameters that mean the same to both programs; most laws differ in form and have none."""
    q, where = effect["parameters"], effect["where"]
    cart = where[-1]
    meaning: dict[str, tuple[str, float | None]] = {
        **{id_: (ours, q.get(theirs.format(cart=cart))) for id_, (ours, theirs) in SAME_SIZES.items()},
        "tilt": ("F", q["pull_1"] + q["pull_2"] if "pull_1" in q else None),
        "extra_mode": ("frequency", sqrt(q["tail_k"] / q["tail_m"]) / (2.0 * pi) if "tail_m" in q else None),
        "cogging": ("P", q.get("period")),
        "encoder_eccentricity": ("P", q.get(f"wheel{cart}")),
    }
    name, true = meaning.get(effect["id"], ("", None))
    if true is None or name not in finding["parameters"]:
        return []
    estimate = finding["parameters"][name]
    low, high = (_number(v) for v in estimate["ci95"])
    return [Known(f"{effect['id']}.{name}", true, estimate["value"], low <= true <= high)]
