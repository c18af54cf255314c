"""How large effects usually are on a rig: as large as on the handout's rig, in proportion to commands, speeds and ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units
from identification.replay.output_error import Run

# of the handout's experiments on rigs like its own: rms command [V] and velocity [mm/s], and the longest way [mm]
_COMMAND, _VELOCITY, _WAY = 1.75, 75.0, 110.0
# what electronics take has nothing to do with how a rig is moved
_TIMES = frozenset({"s", "1/s", "Hz"})


@dataclass(frozen=True)
class Scale:
    """Commands, speeds and ways of a data set over those of the handout's experiments.

    They are powers of ten, for what is usual is known to no more than a factor of three.
    """

    command: float = 1.0
    velocity: float = 1.0
    way: float = 1.0

    @classmethod
    def of(cls, runs: Sequence[Run]) -> Scale:
        """Return the scale of prepared recordings."""
        carts = range(len(runs[0].keep))
        moving = [run for run in runs if not run.positions]
        speeds = [_rms([run.measured[c][run.keep[c]] for run in moving]) for c in carts]
        ways = [float(np.ptp(run.track[c])) for run in runs for c in carts]
        return cls(
            _decade(_rms([run.u for run in runs]) / _COMMAND),
            _decade(max(speeds) / _VELOCITY),
            _decade(max(ways) / _WAY),
        )

    def of_unit(self, unit: str) -> float:
        """Return the factor of a quantity in a unit of the catalogue; a time is the same on every rig."""
        units = Units(per_length=self.way, per_command=self.command, per_time=self.way / self.velocity)
        return 1.0 if unit in _TIMES else units.one(unit)


# that of the handout's rig
HANDOUT = Scale()


def _rms(signals: Sequence[FloatArray]) -> float:
    """Return the root mean square of all that is known of some signals; 0 where nothing is."""
    known = np.concatenate([x[np.isfinite(x)] for x in signals]) if signals else np.zeros(0)
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _decade(ratio: float) -> float:
    """Return a ratio as a power of ten; 1 where nothing tells it."""
    return float(10.0 ** round(float(np.log10(ratio)))) if ratio > 0.0 else 1.0
