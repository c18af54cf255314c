"""Whether the numbers can be what their columns say: wrong units and silent commands.

A wrong unit is worse than a missing file, because everything downstream still runs. Each rule below is a
bound that no run of a laboratory drive (carts of about a kilogram, a track of about a metre, some volts)
reaches and that a mislabelled unit always does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.errors import broken
from identification.recordings.motion import FASTEST, LONGEST_LEAP, RAREST, leaps

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray

SLOWEST_PEAK = 0.5  # mm/s that a cart driven by more than DRIVEN exceeds, if it moves at all
DRIVEN = 0.5  # V
LONGEST_TRACK = 5000.0  # mm
STRONGEST = 100.0  # V
TINY_TRAVEL = 0.2  # mm
METRE_QUANTUM = (1e-6, 2e-5)  # an encoder count of micrometres, written in m: about 5e-6
FACTOR = 5.0  # by which two measures of the same motion may differ; unit errors are 10 or 1000
MISMATCH = 300.0  # by which reference and position may differ: an unstable loop overshoots, but not like this


def check_units(signals: dict[str, FloatArray], quantum: dict[str, float], Ts: float, source: str) -> None:
    """Refuse signals whose size contradicts their unit.

    Parameters
    ----------
    signals
        Signals in V, mm and mm/s by name, each ndarray, shape (n,); NaN allowed.
    quantum
        Smallest step of each measured column, in its own unit; 0 where it shows none.
    Ts
        Sampling period [s].
    source
        File name for messages.

    Raises
    ------
    RecordingError
        Naming the column, the rule, the value and the remedy.
    """
    drive = _peak(signals["u"])
    if drive > STRONGEST:
        raise broken(
            source,
            "column u",
            f"|u| must stay below {STRONGEST:g} V",
            f"{drive:.4g} V",
            "If it is in millivolts, rename it u_mV.",
        )
    for name, values in signals.items():
        if name.startswith("x"):
            _check_position(name, values, quantum.get(name, 0.0), source)
        elif name.startswith("v"):
            _check_velocity(name, values, quantum.get(name, 0.0), drive, source)
    for cart in "12":
        if f"x{cart}" in signals and f"v{cart}" in signals:
            _check_agreement(f"v{cart}", signals[f"v{cart}"], signals[f"x{cart}"], Ts, source)
    if "xr" in signals:
        _check_reference(signals, source)


def _peak(values: FloatArray) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else 0.0


def _travel(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0


def _check_position(name: str, values: FloatArray, quantum: float, source: str) -> None:
    peak = _peak(values)
    if peak > LONGEST_TRACK:
        raise broken(
            source,
            f"column {name}",
            f"|{name}| must stay below {LONGEST_TRACK:g} mm",
            f"{peak:.4g} mm",
            f"If the file holds millimetres, rename it {name}_mm; if micrometres, {name}_um.",
        )
    if peak < TINY_TRAVEL and METRE_QUANTUM[0] <= quantum <= METRE_QUANTUM[1]:
        raise broken(
            source,
            f"column {name}",
            f"positions must move {TINY_TRAVEL:g} mm or have a count above {METRE_QUANTUM[1]:g} mm",
            f"at most {peak:.4g} mm in counts of {quantum:.3g} mm",
            f"The column looks like metres: rename it {name}_m.",
        )


def _check_velocity(name: str, values: FloatArray, quantum: float, drive: float, source: str) -> None:
    peak = _peak(values)
    if peak > FASTEST and not _leaps_only(values):
        raise broken(
            source,
            f"column {name}",
            f"|{name}| must stay below {FASTEST:g} mm/s but for single leaps of a faulty encoder",
            f"{peak:.4g} mm/s",
            f"If the file holds mm/s, rename it {name}_mm_s; if micrometres per second, {name}_um_s.",
        )
    # friction may hold a cart (then v is exactly 0), and an ideal cart 2 hardly answers a 20 Hz sine: that
    # one counts only where an encoder made it
    if drive > DRIVEN and 0.0 < peak < SLOWEST_PEAK and (name == "v1" or quantum > 0.0):
        raise broken(
            source,
            f"column {name}",
            f"a cart that moves under more than {DRIVEN:g} V exceeds {SLOWEST_PEAK:g} mm/s",
            f"at most {peak:.3g} mm/s under {drive:.3g} V",
            f"The column looks like m/s: rename it {name}_m_s.",
        )


def _leaps_only(values: FloatArray) -> bool:
    """Whether a velocity is too fast in rare, short leaps only, which are a fault of the encoder and not of the unit."""
    lengths = [last - first + 1 for first, last in leaps(values)]
    fast = np.abs(np.nan_to_num(values)) > 0.25 * FASTEST
    # in a wrong unit the samples beside the leaps are too fast as well
    return max(lengths) <= LONGEST_LEAP and np.count_nonzero(fast) == sum(lengths) <= max(RAREST * values.size, 1)


def _check_agreement(name: str, velocity: FloatArray, position: FloatArray, Ts: float, source: str) -> None:
    """Compare the integral of velocity with the position of the same cart."""
    good = np.isfinite(velocity) & np.isfinite(position)
    integral = _travel(np.cumsum(velocity[good]) * Ts)
    travel = _travel(position[good])
    # below a tenth of a millimetre an encoder's count decides the ratio, not the unit
    if min(travel, integral) <= 0.0 or max(travel, integral) < 0.1:
        return
    ratio = travel / integral
    if not 1.0 / FACTOR <= ratio <= FACTOR:
        raise broken(
            source,
            f"column {name}",
            f"its integral must agree with x{name[1]}",
            f"{integral:.4g} mm against {travel:.4g} mm of travel, a factor of {max(ratio, 1.0 / ratio):.3g}",
            f"Give both columns their units, for example {name}_m_s or x{name[1]}_m.",
        )


def _check_reference(signals: dict[str, FloatArray], source: str) -> None:
    wanted = _travel(signals["xr"])
    done = max((_travel(signals[name]) for name in ("x1", "x2") if name in signals), default=0.0)
    if min(wanted, done) > 0.0 and max(wanted / done, done / wanted) > MISMATCH:
        raise broken(
            source,
            "column xr",
            f"reference and positions must be within a factor of {MISMATCH:g}",
            f"{wanted:.4g} mm of reference against {done:.4g} mm of travel",
            "Give the columns their units, for example xr_m or x1_mm.",
        )


def check_excitation(u: FloatArray, source: str) -> tuple[str, ...]:
    """Refuse a run without command; note a constant one.

    Parameters
    ----------
    u
        Command [V], ndarray, shape (n,).
    source
        File name for messages.

    Returns
    -------
    tuple of str

    Raises
    ------
    RecordingError
        If u is zero throughout: such a run tells nothing about the drive.
    """
    if np.ptp(u) > 0.0:
        return ()
    if u[0] == 0.0:
        raise broken(
            source,
            "column u",
            "the drive must be excited",
            "u is constant, 0 V throughout",
            "Check the command channel, and record a square, a sine or a closed-loop run.",
        )
    return (f"u is constant at {u[0]:.4g} V",)
