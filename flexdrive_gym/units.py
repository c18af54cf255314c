r"""Units of a rig, and the scale on which the drive is simulated.

The equations are free of scale, but step tolerances and the catalogue's bounds are those of the lab: volts, millimetres,
seconds. A rig that is measured in radians and newton metres is brought to that scale by a choice of units: with :math:`L`
of the engine's millimetres in one unit of length, :math:`U` of its volts in one of command and :math:`T` of its seconds in one
second, every equation keeps its form, and a figure of dimension :math:`V^a\,mm^b\,s^c` is divided by :math:`U^a L^b T^c` on
the way back. Recordings and drives hold the engine's numbers and their units; whatever is printed goes through
:meth:`Units.of_rig`. Results declare the unit of a field where the field is declared (:func:`measured_in`), and
:func:`in_rig_units` turns a whole result.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from math import pi
from typing import Any, TypeVar

import numpy as np

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"^(mm|Hz|V|s)([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*)$")
_TOKEN = re.compile(r"(?<![A-Za-z])(mm|V)(?![A-Za-z])")
_BRACKETS = re.compile(r"\[[^\[\]]*\]")
# radians in units of an angle
ANGLES = (
    {"rad": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3}
    | dict.fromkeys(("deg", "degree", "degrees"), pi / 180.0)
    | dict.fromkeys(("rev", "revs", "turn", "turns", "revolutions"), 2.0 * pi)
)

T = TypeVar("T")


@dataclass(frozen=True)
class Units:
    """The units of a rig and how many of the engine's make one of each.

    Attributes
    ----------
    length, command
        Names of the rig's units of position and command, such as ``mm`` and ``V``, or ``rad`` and ``N m``.
    per_length, per_command, per_time
        Engine's mm, V and s in one unit of length, one of command and one second of the rig.
    """

    length: str = "mm"
    command: str = "V"
    per_length: float = 1.0
    per_command: float = 1.0
    per_time: float = 1.0

    @property
    def revolution(self) -> float | None:
        """Return the engine's mm in one turn of an axis that is measured by its angle; ``None`` for what moves along a line."""
        angle = ANGLES.get(self.length.lower())
        return None if angle is None else 2.0 * pi / angle * self.per_length

    @property
    def lab(self) -> bool:
        """Whether these are the lab's own units, so that figures need no conversion."""
        return self == LAB

    def name(self, unit: str) -> str:
        """Return the rig's name for one of the lab's units: ``V s²/mm`` becomes ``N m s²/rad``."""
        return _TOKEN.sub(lambda found: self.length if found[1] == "mm" else self.command, unit)

    def label(self, text: str) -> str:
        """Return a label, heading or column with the lab's units in its square brackets told as the rig's."""
        return text if self.lab else _BRACKETS.sub(lambda found: self.name(found[0]), text)

    def one(self, unit: str) -> float:
        """Return how many of the engine's units make one of the rig's.

        Parameters
        ----------
        unit
            As in the catalogue, such as ``V s²/mm`` or ``V/mm³``; words that are no unit count as 1.
        """
        over, *under = unit.split("/")
        size = 1.0
        sizes = {"mm": self.per_length, "s": self.per_time, "V": self.per_command, "Hz": 1.0 / self.per_time}
        for part, sign in [(over, 1), *((p, -1) for p in under)]:
            for word in part.split():
                found = _FACTOR.match(word.strip("()[]"))
                if found:
                    size *= sizes[found[1]] ** (sign * int(found[2].translate(_SUPERSCRIPTS) or 1))
        return size

    def of_rig(self, value: float, unit: str) -> tuple[float, str]:
        """Return a figure in the rig's units, and their name.

        Parameters
        ----------
        value
            In the engine's units.
        unit
            The lab's name of its unit.
        """
        return value / self.one(unit), self.name(unit)

    def text(self, value: float, unit: str, digits: int = 4) -> str:
        """Return a figure of the engine in words of the rig: ``0.1234 V/mm``."""
        size, name = self.of_rig(value, unit)
        return f"{size:.{digits}g} {name}"

    def to_engine(self, value: float, unit: str) -> float:
        """Return a figure of the rig in the engine's units; ``unit`` is the lab's name."""
        return value * self.one(unit)


LAB = Units()


def measured_in(unit: str | tuple[str, ...] | None, *, keys: str = "") -> dict[str, Any]:
    """Return the metadata of a dataclass's field that tell :func:`in_rig_units` its unit.

    Parameters
    ----------
    unit
        The lab's name of it, of a number, an array or a collection of such; one per row for a table of signals; ``None`` where
        the field keeps what the engine needs (controllers, cases).
    keys
        Unit of the keys of a mapping that has numbers for keys.
    """
    return {"unit": unit, "keys": keys}


def in_rig_units(result: T, units: Units, unit: str | tuple[str, ...] | None = "") -> T:
    """Return a result with the numbers that the rig's owner reads.

    Parameters
    ----------
    result
        A dataclass whose fields say their units by :func:`measured_in`; dataclasses, mappings and sequences within it are turned
        too. What carries units of its own turns itself. A number without unit stays.
    units
        The rig's.
    unit
        Of ``result`` itself, where it is a number or a collection of numbers.
    """
    if unit is None or units.lab:
        return result
    turned: Any = result
    if is_dataclass(result) and not isinstance(result, type):
        own = getattr(result, "in_rig_units", None)
        if own is not None:
            return own()  # type: ignore[no-any-return]
        changes = {
            f.name: in_rig_units(getattr(result, f.name), units, f.metadata.get("unit", unit))
            for f in fields(result)
            if f.init
        }
        for f in fields(result):
            if keys := f.metadata.get("keys"):
                changes[f.name] = {key / units.one(keys): value for key, value in changes[f.name].items()}
        turned = replace(result, **changes)
    elif isinstance(result, Mapping):
        turned = {key: in_rig_units(value, units, unit) for key, value in result.items()}
    elif isinstance(result, tuple | list):
        turned = type(result)(in_rig_units(value, units, unit) for value in result)
    elif isinstance(result, np.ndarray) and isinstance(unit, tuple):
        turned = result / np.array([units.one(name) for name in unit]).reshape(-1, *[1] * (result.ndim - 1))
    elif isinstance(result, float | np.floating | np.ndarray) and isinstance(unit, str) and unit:
        turned = result / units.one(unit)
    return turned  # type: ignore[no-any-return]
