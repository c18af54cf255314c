r"""Units in which another rig looks like the lab's.

The catalogue and the search know how large effects usually are in the lab's volts, millimetres and seconds. A rig of another size
is brought to that scale by the choice of its units: with :math:`L` units of length, :math:`T` of time and :math:`U` of voltage
to one of the lab's, every equation keeps its form, and a parameter of dimension :math:`V^a\,mm^b\,s^c` is divided by
:math:`U^a L^b T^c` on the way back.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"(mm|Hz|V|s)([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*)")


@dataclass(frozen=True)
class Units:
    """How many of the engine's units make one of the rig's.

    Attributes
    ----------
    output
        Name of the rig's unit of position.
    length, time, voltage
        Engine's mm, s and V in one ``output``, one second and one volt of the rig.
    """

    output: str = "mm"
    length: float = 1.0
    time: float = 1.0
    voltage: float = 1.0

    def of_rig(self, value: float, unit: str) -> tuple[float, str]:
        """Return a parameter in the rig's units and their name.

        Parameters
        ----------
        value
            In the engine's units.
        unit
            As in the catalogue, such as ``V s²/mm`` or ``V/mm³``.
        """
        over, *under = unit.split("/")
        divisor = 1.0
        for part, sign in [(over, 1), *((p, -1) for p in under)]:
            for name, power in _FACTOR.findall(part):
                exponent = sign * int(power.translate(_SUPERSCRIPTS) or 1)
                one = {"mm": self.length, "s": self.time, "V": self.voltage, "Hz": 1.0 / self.time}[name]
                divisor *= one**exponent
        return value / divisor, unit.replace("mm", self.output)
