"""Which experiment would separate what the recordings cannot tell apart.

The drive of a finding and the drives of its ties, all fitted to the same recordings, are simulated on many excitations; where
their velocities differ most against the floor, one more recording decides between them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.signal import sawtooth

from flexdrive_gym import Drive
from flexdrive_gym.files import write_atomically
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import chirp, sine, square
from identification.mismatch.answer.errors import total
from identification.mismatch.answer.verdict import Diagnosis

Kind = Literal["sine", "square", "ramp", "chirp"]

DURATION_S, SAMPLE_TIME_S = 8.0, 1e-3
COMMAND_LIMIT_V, TRAVEL_MM = 8.0, 250.0
AMPLITUDES_V = (0.7, 1.0, 1.5, 2.0, 3.0, 4.0)
FREQUENCIES_HZ: Mapping[Kind, tuple[float, ...]] = {
    "sine": (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0, 20.0, 40.0),
    "square": (0.2, 0.5, 1.0, 2.0),
    "ramp": (0.1, 0.2, 0.5),
    "chirp": (10.0, 20.0, 40.0),
}
# used where nothing repeats in the recordings: what friction that differs from run to run leaves on the rigs seen [mm/s]
_USUAL_FLOOR = 3.0


@dataclass(frozen=True, eq=False)
class Suggestion:
    """An experiment and what it would tell.

    Attributes
    ----------
    kind, amplitude, frequency
        Of the command [V, Hz]; the frequency of a chirp is its last.
    separation
        Rms difference of the velocities between a finding's drive and each of its ties', in multiples of the floor.
    t, u : ndarray, shape (n,)
        The command [s, V].
    rank
        1 tells most.
    """

    kind: Kind
    amplitude: float
    frequency: float
    separation: Mapping[str, float]
    t: FloatArray
    u: FloatArray
    rank: int

    @property
    def file(self) -> str:
        """Name of its input file."""
        return f"suggest_{self.rank}_{self.kind}_{self.amplitude:g}V_{self.frequency:g}Hz.csv"

    def as_json(self) -> dict[str, Any]:
        """Return the object of ``diagnosis.json``."""
        return {
            "file": self.file,
            "kind": self.kind,
            "amplitude_V": self.amplitude,
            "frequency_Hz": self.frequency,
            "separation": dict(self.separation),
        }


def command(kind: Kind, amplitude: float, frequency: float) -> tuple[FloatArray, FloatArray]:
    """Return time and command of an excitation, each of shape (8001,) [s, V]."""
    t = np.asarray(np.arange(round(DURATION_S / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S, dtype=np.float64)
    if kind == "square":
        return t, square(t, amplitude, frequency)
    if kind == "sine":
        return t, sine(t, amplitude, frequency)
    if kind == "ramp":
        # a triangle that begins at zero and rises
        return t, np.asarray(amplitude * sawtooth(2.0 * np.pi * frequency * t + 0.5 * np.pi, 0.5))
    return t, chirp(t, amplitude, 0.1, frequency, DURATION_S)


def explanations(diagnosis: Diagnosis) -> dict[str, tuple[Drive, Drive]]:
    """Return pairs of drives that are to be told apart, by their names: a finding's and a tie's, fitted in the same round."""
    return {f"{f.name} or {other.name}": (f.drives[0], other) for f in diagnosis.findings for other in f.drives[1:]}


def suggest_experiments(diagnosis: Diagnosis, *, most: int = 3) -> tuple[Suggestion, ...]:
    """Return the experiments that separate findings from their ties best, at most one of each kind and frequency.

    Ranked by the separation of the pair that they separate least, because all are to be told apart. Excitations that would
    drive a cart farther than ±250 mm are left out.

    Returns
    -------
    tuple of Suggestion
        Empty where there are no ties.
    """
    pairs = explanations(diagnosis)
    if not pairs:
        return ()
    floor = _floor(diagnosis)
    judged = []
    for kind, amplitude, frequency in _excitations():
        separation = _separation(pairs, kind, amplitude, frequency, floor)
        if separation is not None:
            judged.append((min(separation.values()), kind, amplitude, frequency, separation))
    judged.sort(key=lambda item: -item[0])
    chosen: list[Suggestion] = []
    for _, kind, amplitude, frequency, separation in judged:
        if len(chosen) == most:
            break
        # the same wave at another amplitude tells much the same
        if any(s.kind == kind and s.frequency == frequency for s in chosen):
            continue
        t, u = command(kind, amplitude, frequency)
        chosen.append(Suggestion(kind, amplitude, frequency, separation, t, u, len(chosen) + 1))
    return tuple(chosen)


def _floor(diagnosis: Diagnosis) -> float:
    """Return the floor of the estimation recordings [mm/s]."""
    floor = total(f for f in diagnosis.per_recording if f.part == "estimation")[2]
    return floor * diagnosis.base.units.one("mm/s") if math.isfinite(floor) else _USUAL_FLOOR


def _excitations() -> Iterator[tuple[Kind, float, float]]:
    for kind, frequencies in FREQUENCIES_HZ.items():
        for frequency in frequencies:
            for amplitude in AMPLITUDES_V:
                yield kind, amplitude, frequency


def _separation(
    pairs: Mapping[str, tuple[Drive, Drive]], kind: Kind, amplitude: float, frequency: float, floor: float
) -> dict[str, float] | None:
    """Return the difference within every pair in multiples of the floor, or ``None`` where a cart would leave the track."""
    t, u = command(kind, amplitude, frequency)
    found = {}
    for name, (own, other) in pairs.items():
        ours, theirs = _velocities(own, t, u), _velocities(other, t, u)
        if ours is None or theirs is None:
            return None
        found[name] = float(np.sqrt(np.mean((ours - theirs) ** 2))) / floor
    return found


def _velocities(drive: Drive, t: FloatArray, u: FloatArray) -> FloatArray | None:
    run = drive.replace({"saturation.limit": min(drive.voltage_limit, COMMAND_LIMIT_V)}).simulate(
        t, u, travel_limit=TRAVEL_MM
    )
    if run.n < len(t):
        return None
    return np.vstack([v for v in (run.v1, run.v2) if v is not None])


def write_suggestions(suggestions: Sequence[Suggestion], folder: Path) -> list[Path]:
    """Write the input files for the rig: ``t_s,u_V`` at 1 kHz."""
    written = []
    for s in suggestions:
        lines = [f"{t:.3f},{u:.6g}" for t, u in zip(s.t, s.u + 0.0, strict=True)]
        written.append(write_atomically(folder / s.file, "\n".join(["t_s,u_V", *lines]) + "\n"))
    return written
