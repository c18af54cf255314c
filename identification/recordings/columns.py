"""Which signal a column holds, and in which unit, from its name.

Logs come from spreadsheets, Simulink and scripts, and name the same signal ``t``, ``Time (s)`` or ``t_ms``.
A name is a stem (what is measured) and an optional unit, in brackets or after a separator. The unit is
looked up only among the units of the stem's dimension, so ``ms`` is a millisecond after ``t`` and a metre
per second after ``v1``.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from identification.recordings.errors import RecordingError, broken

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Signal = Literal["t", "u", "x1", "x2", "v1", "v2", "xr"]
Dimension = Literal["time", "voltage", "length", "velocity"]

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

_TIME = ("t", "time", "timestamp", "timestamps", "tout", "elapsedtime")
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

_BRACKETS = re.compile(r"^(?P<stem>.*?)\s*[\[({](?P<unit>[^\])}]*)[\])}]\s*$")
_SEPARATOR = re.compile(r"[\s_/,.:-]+")


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
        Multiply by this to get s, V, mm or mm/s.
    """

    label: str
    signal: Signal
    factor: float = 1.0


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
    base = re.sub(r"cart|mass|encoder", "", name)
    digits = "".join(re.findall(r"\d", base))
    base = re.sub(r"\d", "", base)
    if digits not in ("", "1", "2"):
        return None
    if base in _REFERENCE:
        return "xr"
    if base in _POSITION:
        return "x2" if digits == "2" else "x1"
    if base in _VELOCITY or (base == "v" and digits):
        return "v2" if digits == "2" else "v1"
    return None


def _factor(signal: Signal, unit: str) -> float | None:
    return _UNITS[DIMENSION[signal]].get(_plain(unit))


def recognise_column(label: str, source: str = "columns") -> Column | None:
    """Return the signal and unit of a column name, or ``None`` for an unknown name.

    Parameters
    ----------
    label
        Name as found in the file, for example ``v1 [mm/sec]``.
    source
        File name for the error message.

    Returns
    -------
    Column or None
        Without a unit s, V, mm and mm/s are assumed.

    Raises
    ------
    RecordingError
        If the name is known but the unit in its brackets is not.
    """
    bracket = _BRACKETS.match(label)
    if bracket is not None:
        signal = _signal(bracket["stem"])
        if signal is None:
            return None
        factor = _factor(signal, bracket["unit"]) if bracket["unit"].strip() else 1.0
        if factor is None:
            raise _no_unit(source, label, signal, bracket["unit"])
        return Column(label, signal, factor)
    # the unit is the longest tail that is a unit of what the head names: v1 | mm_s, never v1_mm | s
    for cut in _SEPARATOR.finditer(label):
        signal = _signal(label[: cut.start()])
        factor = None if signal is None else _factor(signal, label[cut.end() :])
        if signal is not None and factor is not None:
            return Column(label, signal, factor)
    signal = _signal(label)
    return None if signal is None else Column(label, signal)


def assign_columns(labels: Sequence[str], source: str) -> tuple[dict[int, Column], tuple[str, ...]]:
    """Recognise every column of a file.

    Parameters
    ----------
    labels
        Column names in file order.
    source
        File name for the error messages.

    Returns
    -------
    columns : dict
        Recognised columns by their place in ``labels``.
    notes : tuple of str
        One note naming the columns that were ignored, if any.

    Raises
    ------
    RecordingError
        If two columns hold the same signal.
    """
    columns: dict[int, Column] = {}
    seen: dict[Signal, str] = {}
    ignored = []
    for place, label in enumerate(labels):
        column = recognise_column(label, source)
        if column is None:
            ignored.append(label)
            continue
        if column.signal in seen:
            raise broken(
                source,
                f"column {label}",
                "each signal may appear once",
                f"{seen[column.signal]} and {label}, both {column.signal}",
                f"Keep one of them, or rename the other so that it is not taken for {column.signal}.",
            )
        seen[column.signal] = label
        columns[place] = column
    notes = (f"columns ignored: {', '.join(ignored)}",) if ignored else ()
    return columns, notes


def only_reference(columns: Iterable[Column]) -> bool:
    """Return whether the columns are those of a reference trajectory: time and xr and nothing else."""
    return {column.signal for column in columns} == {"t", "xr"}


def require_columns(columns: Iterable[Column], labels: Sequence[str], source: str) -> None:
    """Check that time, command and at least one measurement are there.

    Raises
    ------
    RecordingError
        Naming what is missing, what the file has and the nearest name.
    """
    have = {column.signal for column in columns}
    got = f"columns {', '.join(labels)}" if labels else "no columns"
    for wanted, meaning, example in (
        (("t",), "time", "t_s"),
        (("u",), "the command", "u_V"),
        (MEASURED, "at least one of x1, x2, v1, v2", "x1_mm"),
    ):
        if have.isdisjoint(wanted):
            for label in labels:
                strange = _strange_unit(label)
                if strange is not None and strange[0] in wanted:
                    raise _no_unit(source, label, *strange)
            raise _missing(source, meaning, example, labels, got)


def _strange_unit(label: str) -> tuple[Signal, str] | None:
    """Return the signal and the tail of a name that is a signal and something else, which is no unit of it."""
    if _BRACKETS.match(label) or recognise_column(label) is not None:
        return None
    for cut in _SEPARATOR.finditer(label):
        signal = _signal(label[: cut.start()])
        if signal is not None:
            return signal, label[cut.end() :]
    return None


def _no_unit(source: str, label: str, signal: Signal, unit: str) -> RecordingError:
    lab = LAB_UNIT[DIMENSION[signal]]
    return broken(
        source,
        f"column {label}",
        f"the unit must be one of {DIMENSION[signal]}, for example {lab}",
        unit,
        f"Convert the column to {lab} and rename it {signal} [{lab}].",
    )


def _missing(source: str, meaning: str, example: str, labels: Sequence[str], got: str) -> RecordingError:
    near = difflib.get_close_matches(example.lower(), [label.lower() for label in labels], n=1, cutoff=0.6)
    hint = f" Is {near[0]} meant?" if near and recognise_column(near[0]) is None else ""
    return broken(
        source, "columns", f"must contain {meaning}", got, f"Name that column {example}, unit included.{hint}"
    )
