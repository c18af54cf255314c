"""The scale on which recordings of a rig with units of its own are simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.rig import scaled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexdrive_gym.recording import FloatArray
    from flexdrive_gym.units import Units
    from identification.recordings.parsed import Parsed
    from identification.recordings.rig import Rig

USUAL_COMMAND = 2.0  # V that the lab's runs reach
USUAL_TRAVEL = 50.0  # mm that its carts travel


def choose_units(rig: Rig, parsed: Sequence[Parsed]) -> Units:
    """Return the units of a set: powers of ten that bring the median run to the lab's volts and millimetres.

    Millimetres and volts keep their size, and ``[scale]`` of the description holds before the data.
    """
    return scaled(
        rig,
        _power(USUAL_TRAVEL, [_travel(item) for item in parsed]),
        _power(USUAL_COMMAND, [_peak(item.uniform.signals["u"]) for item in parsed]),
    )


def _power(usual: float, sizes: Sequence[float]) -> float:
    found = [size for size in sizes if size > 0.0]
    return float(10.0 ** round(np.log10(usual / float(np.median(found))))) if found else 1.0


def _peak(values: FloatArray) -> float:
    return float(np.max(np.abs(values)))


def _travel(parsed: Parsed) -> float:
    """Return how far the cart that moves most travels, from positions or integrated velocities."""
    signals = parsed.uniform.signals
    paths = [signals[name] for name in ("x1", "x2") if name in signals]
    if not paths:
        paths = [np.cumsum(signals[name]) * parsed.Ts for name in ("v1", "v2") if name in signals]
    return max((float(np.ptp(path)) for path in paths), default=0.0)
