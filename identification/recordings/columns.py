"""Which signal a column holds, and in which unit, from its name.

Logs come from spreadsheets, Simulink and scripts, and name the same signal ``t``, ``Time (s)`` or ``t_ms``.
A name is a stem (what is measured) and an optional unit, in brackets or after a separator. The unit is
looked up only among the units of the stem's dimension, so ``ms`` is a millisecond after ``t`` and a metre
per second after ``v1``. Words before or behind say whence a signal comes: ``x1_exp`` and ``v1_raw`` were measured,
``v1_filt`` was filtered, ``x1_sim`` was simulated.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import nan, pi
from typing import Literal

from flexdrive_gym.units import ANGLES
from identification.recordings.errors import RecordingError, broken

Signal = Literal["t", "u", "x1", "x2", "v1", "v2", "xr"]
Dimension = Literal["time", "voltage", "length", "velocity"]
Origin = Literal["measured", "plain", "filtered", "simulated"]

MEASURED: tuple[Signal, ...] = ("x1", "x2", "v1", "v2")
LAB_UNIT: dict[Dimension, str] = {"time": "s", "voltage": "V", "length": "mm", "velocity": "mm/s"}
DIMENSION: dict[Signal, Dimension] = {
    "t": "time",
    "u": "voltage",
    "x1": "length",
    "x2": "length",
    "xr": "length",
    "v1": "velocity",
    "v2": "velocity",
}

_TIME = ("t", "time", "timestamp", "timestamps", "tout", "elapsedtime", "xvalue")
_COMMAND = (
    "u",
    "uin",
    "ucmd",
    "vin",
    "cmd",
    "command",
    "control",
    "controlsignal",
    "input",
    "voltage",
    "motorvoltage",
    "inputvoltage",
    "commandvoltage",
    "voltagecommand",
    "effort",
    "controleffort",
    "controlinput",
    "duty",
    "dutycycle",
    "torquecommand",
    "commandtorque",
    "currentcommand",
)
# which are no voltages, whatever their unit is
NO_VOLTS = frozenset(
    ("effort", "controleffort", "duty", "dutycycle", "torquecommand", "commandtorque", "currentcommand")
)
_REFERENCE = (
    "xr",
    "xref",
    "xd",
    "xdes",
    "qref",
    "r",
    "ref",
    "reference",
    "setpoint",
    "target",
    "desired",
    "trajectory",
    "positionreference",
    "referenceposition",
)
# A cart's number may stand anywhere in the name (x1, position_2, cart2_velocity); without one it is cart 1.
# A bare "v" is absent because it is as often a voltage.
_POSITION = ("x", "q", "pos", "position", "displacement")
# the motor drives cart 1, and its load is cart 2
_BODIES = {"motor": "1", "load": "2"}
_VELOCITY = ("vel", "velocity", "speed", "dx", "dq", "xdot", "qdot")

_METRES = {
    1.0: ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    10.0: ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    1000.0: ("m", "metre", "metres", "meter", "meters"),
    1e-3: ("um", "µm", "μm", "micron", "microns"),
}
_PER_SECOND = ("s", "sec", "second", "ps", "s1", "pers", "persec", "persecond")

_UNITS: dict[Dimension, dict[str, float]] = {
    "time": dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0)
    | dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3)
    | dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), 1e-6),
    "voltage": dict.fromkeys(("v", "volt", "volts"), 1.0) | dict.fromkeys(("mv", "millivolt", "millivolts"), 1e-3),
    "length": {name: factor for factor, names in _METRES.items() for name in names},
    "velocity": {name + per: factor for factor, names in _METRES.items() for name in names for per in _PER_SECOND},
}

# units that other rigs measure in, by what they stand for, and how many of the first of a group one of each is
_KINDRED: tuple[tuple[Dimension, dict[str, float]], ...] = (
    ("length", ANGLES),
    (
        "velocity",
        {"rads": 1.0, "radsec": 1.0, "radps": 1.0, "rads1": 1.0, "mrads": 1e-3}
        | dict.fromkeys(("degs", "degsec", "degps", "dps"), pi / 180.0)
        | {"rpm": pi / 30.0, "revmin": pi / 30.0, "revs1": 2.0 * pi},
    ),
    ("voltage", dict.fromkeys(("nm", "newtonmetre", "newtonmeter", "newtonmetres"), 1.0) | {"mnm": 1e-3, "ncm": 1e-2}),
    ("voltage", dict.fromkeys(("a", "amp", "amps", "ampere", "amperes"), 1.0) | {"ma": 1e-3}),
    ("voltage", dict.fromkeys(("n", "newton", "newtons"), 1.0)),
    ("length", dict.fromkeys(("count", "counts", "cts", "ticks", "tick", "pulses", "pulse", "lsb", "increments"), 1.0)),
    ("velocity", dict.fromkeys(("countss", "ctss", "tickss", "pulsess"), 1.0)),
    ("voltage", dict.fromkeys(("dac", "dacunits", "bits", "bit"), 1.0)),
    ("voltage", dict.fromkeys(("percent", "pct", "pwm"), 1.0)),
)
_FOREIGN = {name for _, group in _KINDRED for name in group}

_SAID: dict[Origin, str] = {
    "measured": "exp expt experiment experimental meas measured measurement raw actual act real logged recorded rec "
    "applied sat saturated clipped limited",
    "filtered": "filt filtered filter flt lpf lp lowpass smooth smoothed",
    "simulated": "sim simulated simulation model mdl pred predicted est estimated hat theory theoretical ideal nominal",
    "plain": "scopedata scope data log out logsout signal",
}
_WORDS: dict[str, Origin] = {word: origin for origin, words in _SAID.items() for word in words.split()}
# of a command that is limited before it acts
LIMITED = frozenset(("applied", "sat", "saturated", "clipped", "limited"))
_RANK: tuple[Origin, ...] = ("measured", "plain", "filtered", "simulated")
_WORD = re.compile(
    rf"(?:^|(?<=[\s_.\-]))(?:{'|'.join(sorted(_WORDS, key=len, reverse=True))})(?=$|[\s_.\-\[(])", re.IGNORECASE
)
# without a separator only these, which end no name of a signal
_GLUED = re.compile(r"^(exp|meas|sim|raw|filt)(?=[a-z]+\d?$)|(?<=[a-z0-9])(exp|meas|sim|raw|filt)$", re.IGNORECASE)

_BRACKETS = re.compile(r"^(?P<stem>.*?)\s*[\[({](?P<unit>[^\])}]*)[\])}]\s*$")
_SEPARATOR = re.compile(r"[\s_/,.:-]+(?:in\s+)?")


@dataclass(frozen=True)
class Column:
    """A recognised column.

    Attributes
    ----------
    label
        The name in the file.
    signal
        What it holds.
    factor
        Multiply by this to get s, V, mm or mm/s; NaN where ``unit`` is none of the lab's.
    unit
        As the name says it; empty where it says none.
    origin
        Whence it comes, as far as its name says.
    words
        What says so.
    """

    label: str
    signal: Signal
    factor: float = 1.0
    unit: str = ""
    origin: Origin = "plain"
    words: tuple[str, ...] = ()

    @property
    def rank(self) -> int:
        """Order of preference: measured, plain, filtered, simulated."""
        return _RANK.index(self.origin)


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9µμ]", "", text.lower())


def _signal(stem: str) -> Signal | None:
    """Return what a name without its unit stands for."""
    name = _plain(stem)
    if name in _TIME:
        return "t"
    if name in _COMMAND:
        return "u"
    if name in _REFERENCE:
        return "xr"
    if name in ("v1", "v2"):
        return "v1" if name == "v1" else "v2"
    base = re.sub(r"cart|mass|encoder|^enc(?=\d|pos|$)", "", name)
    digits = "".join(re.findall(r"\d", base))
    base = re.sub(r"\d", "", base)
    body = next((body for body in _BODIES if body in base), None)
    if body is not None and not digits:
        base, digits = base.replace(body, ""), _BODIES[body]
    if digits not in ("", "1", "2"):
        return None
    if base in _REFERENCE:
        return "xr"
    if base in _POSITION or (not base and digits and "enc" in name):
        return "x2" if digits == "2" else "x1"
    if base in _VELOCITY or (base == "v" and digits):
        return "v2" if digits == "2" else "v1"
    return None


def _factor(signal: Signal, unit: str) -> float | None:
    return _UNITS[DIMENSION[signal]].get(_plain(unit))


def read_label(label: str) -> Column | None:
    """Return what a column's name says, or ``None`` for an unknown name.

    Parameters
    ----------
    label
        Name as found in the file, for example ``v1_filt [mm/sec]``.

    Returns
    -------
    Column or None
        Without a unit s, V, mm and mm/s are assumed; a unit of another kind leaves ``factor`` NaN.
    """
    found = _known(label, label)
    if found is not None:
        return found
    words = tuple(word.lower() for word in _WORD.findall(label))
    bare = _WORD.sub("", label).strip(" _.-") if words else label
    found = _known(label, bare) if words else None
    if found is None:
        stem, unit = _unglued(bare)
        found = _known(label, stem + unit)
        words += tuple(part.lower() for match in _GLUED.findall(_stem(bare)) for part in match if part)
    if found is None or not words:
        return None
    return replace(found, origin=max((_WORDS[word] for word in words), key=_origin_order), words=words)


def _origin_order(origin: Origin) -> int:
    # filtered and simulated say more than measured
    return {"plain": 0, "measured": 1, "filtered": 2, "simulated": 3}[origin]


def _stem(label: str) -> str:
    bracket = _BRACKETS.match(label)
    return bracket["stem"].strip() if bracket else label


def _unglued(label: str) -> tuple[str, str]:
    stem = _stem(label)
    return _GLUED.sub("", stem, count=1), label[len(stem) :]


def _known(label: str, name: str) -> Column | None:
    """Return the column that a name without words of origin stands for."""
    # x(1) counts carts
    name = re.sub(r"[\[({]([12])[\])}]", r"\1", name)
    bracket = _BRACKETS.match(name)
    if bracket is not None:
        signal = _signal(bracket["stem"])
        if signal is None:
            return None
        factor = _factor(signal, bracket["unit"]) if bracket["unit"].strip() else 1.0
        return Column(label, signal, nan if factor is None else factor, bracket["unit"].strip())
    # the unit is the longest tail that is a unit of what the head names: v1 | mm_s, never v1_mm | s
    for foreign in (False, True):
        for cut in _SEPARATOR.finditer(name):
            signal, tail = _signal(name[: cut.start()]), name[cut.end() :]
            factor = None if signal is None else _factor(signal, tail)
            if signal is not None and factor is not None:
                return Column(label, signal, factor, tail)
            if foreign and signal is not None and _plain(tail) in _FOREIGN:
                return Column(label, signal, nan, tail)
    signal = _signal(name)
    return None if signal is None else Column(label, signal)


def no_volts(column: Column) -> bool:
    """Whether a command without a unit is called what is none in volts."""
    return column.signal == "u" and not column.unit and _plain(_WORD.sub("", column.label)) in NO_VOLTS


def with_unit(label: str, signal: Signal) -> Column:
    """Return a column whose role a description tells, with the unit that the end of its name says.

    What brackets hold is one if it is known; after a separator it must have two letters or more, too: the m of ``phi_m`` is a
    motor.
    """
    found = read_label(label)
    if found is not None and found.signal == signal:
        return found
    bracket = _BRACKETS.match(label)
    if bracket is not None and kind_of(label) is not None:
        return Column(label, signal, unit=bracket["unit"].strip())
    known = {*_UNITS[DIMENSION[signal]], *_FOREIGN}
    tails = (label[cut.end() :] for cut in _SEPARATOR.finditer(label))
    return Column(label, signal, unit=next((t for t in tails if len(_plain(t)) > 1 and _plain(t) in known), ""))


def kind_of(label: str) -> Dimension | None:
    """Return what the unit at the end of an unknown name measures; whatever motors are given is a command."""
    bracket, parts = _BRACKETS.match(label), _SEPARATOR.split(label)
    unit = _plain(bracket["unit"] if bracket is not None else parts[-1] if len(parts) > 1 else "")
    return next((kind for kind, group in (*_UNITS.items(), *_KINDRED) if unit in group), None)


def conversion(column: Column, wanted: str) -> float | None:
    """Return the factor from a column's unit to the rig's, or ``None`` where they are of different kinds.

    Parameters
    ----------
    column
        Recognised column.
    wanted
        The rig's unit of its role, such as ``mm/s`` or ``rad``.
    """
    if not column.unit:
        return 1.0
    own, other = _plain(column.unit), _plain(wanted)
    if own == other:
        return 1.0
    groups = (_UNITS[DIMENSION[column.signal]], *(group for _, group in _KINDRED))
    return next((group[own] / group[other] for group in groups if own in group and other in group), None)


def no_unit(source: str, label: str, signal: Signal, unit: str, wanted: str = "") -> RecordingError:
    """Return the error for a column whose unit is not one of the rig's."""
    lab = wanted or LAB_UNIT[DIMENSION[signal]]
    rule = f"the unit must be one of {DIMENSION[signal]}, for example {lab}"
    return broken(source, f"column {label}", rule, unit, unit_remedy(label, signal, unit, lab))


def unit_remedy(label: str, signal: Signal, unit: str, lab: str) -> str:
    """Return what to do about a column whose unit is not known."""
    role, by = "reference" if signal == "xr" else signal, f"the factor from {unit} to {lab}"
    # the name may tell no signal, so that it must be given one, too
    named = "" if read_label(label) is not None else f'[columns] {role} = "{label}" and '
    told = f'[units] {role} = {{ unit = "{lab}", factor = F }}, where F is {by}'
    # time is in seconds, and a velocity in the unit of positions per second
    if DIMENSION[signal] != "time" and (DIMENSION[signal] != "velocity" or unit.endswith("/s")):
        told = f'[units] {role} = {{ unit = "{unit}" }}, or unit = "{lab}" with {by}'
    told = named + told
    return f"Convert the column to {lab} and rename it {signal} [{lab}], or say in rig.toml what it is: {told}."
