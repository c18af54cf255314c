r"""Units of a rig, and the scale on which the drive is simulated.

The equations are free of scale, but step tolerances and the catalogue's usual sizes are those of the lab: volts, millimetres,
seconds. A rig that is measured in radians and newton metres is brought to that scale by a choice of units: with :math:`L`
of the engine's millimetres in one unit of length, :math:`U` of its volts in one of command and :math:`T` of its seconds in one
second, every equation keeps its form, and a figure of dimension :math:`V^a\,mm^b\,s^c` is divided by :math:`U^a L^b T^c` on
the way back. Recordings and drives hold the engine's numbers and their units; whatever is printed goes through
:meth:`Units.of_rig`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"^(mm|Hz|V|s)([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*)$")
_TOKEN = re.compile(r"(?<![A-Za-z])(mm|V)(?![A-Za-z])")


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
    def lab(self) -> bool:
        """Whether these are the lab's own units, so that figures need no conversion."""
        return self == LAB

    @property
    def scale(self) -> str:
        """Say which scale a rig is simulated on, where figures are told on it; empty for the lab's own units."""
        if self.lab:
            return ""
        return (
            f"figures of controllers are on the scale of the lab, where the handout's references and limits live: 1 "
            f"{self.length} is "
            f"{self.per_length:g} mm, 1 {self.command} is {self.per_command:g} V"
        )

    def name(self, unit: str) -> str:
        """Return the rig's name for one of the lab's units: ``V s²/mm`` becomes ``N m s²/rad``."""
        return _TOKEN.sub(lambda found: self.length if found[1] == "mm" else self.command, unit)

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
