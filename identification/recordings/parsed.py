"""One file, understood: what the stages of reading hand on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification.recordings.timing import Uniform

if TYPE_CHECKING:
    from datetime import datetime

    from flexdrive_gym.recording import FloatArray


@dataclass(frozen=True)
class Parsed:
    """One file, understood, in the rig's units.

    Attributes
    ----------
    name, source
        Of the recording, and path from the folder down.
    uniform
        Signals on a uniform time base.
    raw
        Signals before missing values were filled in and samples resampled, by which units are checked.
    steps
        Smallest step of each measured signal; 0 where it shows none.
    cutoff
        How the velocities were made: 0 raw, a cut-off [Hz], or ``None`` if the data do not tell.
    """

    name: str
    source: str
    uniform: Uniform
    raw: dict[str, FloatArray]
    steps: dict[str, float]
    cutoff: float | None
    notes: tuple[str, ...] = ()
    recorded: datetime | None = None
    session: str = ""
    held: tuple[int, ...] = ()

    @property
    def Ts(self) -> float:
        """Sampling period [s]; the time base is uniform."""
        return float(self.uniform.t[1] - self.uniform.t[0])
