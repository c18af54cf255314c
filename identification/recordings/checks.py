"""Whether the numbers can be what their columns say: wrong units and silent commands.

A wrong unit is worse than a missing file, because everything downstream still runs. Each rule below is a
bound that no run of a laboratory drive (carts of about a kilogram, a track of about a metre, some volts)
reaches and that a mislabelled unit always does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexdrive_gym.units import LAB
from identification.recordings.errors import broken
from identification.recordings.motion import FASTEST, LONGEST_LEAP, RAREST, leaps

if TYPE_CHECKING:
    from flexdrive_gym.recording import FloatArray
    from flexdrive_gym.units import Units

SLOWEST_PEAK = 0.5  # mm/s that a cart driven by more than DRIVEN exceeds, if it moves at all
DRIVEN = 0.5  # V
LONGEST_TRACK = 5000.0  # mm
STRONGEST = 100.0  # V
TINY_TRAVEL = 0.2  # mm
METRE_QUANTUM = (1e-6, 2e-5)  # an encoder count of micrometres, written in m: about 5e-6
FACTOR = 5.0  # by which two measures of the same motion may differ; unit errors are 10 or 1000
FEWEST_LEVELS = 20  # of a channel that moved, not only trembled by a count or two
COARSEST_COUNT = 0.25  # mm: laboratory encoders are fifty times finer
FINEST_COUNT = 2e-5  # mm
CARTS_APART = 300.0  # by which the carts' travels may differ: an ideal cart 2 hardly answers a 20 Hz sine
FASTEST_RATE = 1e5  # Hz
WINDOW = 0.02  # s over which a position's speed is taken: many counts
WEAKEST = 0.02  # V that moves no cart
SLOWEST_GAIN, FASTEST_GAIN = 0.5, 5000.0  # mm/s per V; the lab's rig has about 100 and a thousandth is no drive
MISMATCH = 300.0  # by which reference and position may differ: an unstable loop overshoots, but not like this


def check_units(
    signals: dict[str, FloatArray], quantum: dict[str, float], Ts: float, source: str, units: Units = LAB
) -> None:
    """Refuse signals whose size contradicts their unit.

    Parameters
    ----------
    signals
        Signals in the engine's V, mm and mm/s by name, each ndarray, shape (n,); NaN allowed.
    quantum
        Smallest step of each measured column, in its own unit; 0 where it shows none.
    Ts
        Sampling period [s].
    source
        File name for messages.
    units
        The rig's. Bounds of a laboratory drive hold only where it is measured in V or mm; what one signal says of another
        holds for every rig.

    Raises
    ------
    RecordingError
        Naming the column, the rule, the value and the remedy.
    """
    drive = _peak(signals["u"])
    if drive > STRONGEST and units.command == LAB.command:
        raise broken(
            source,
            "column u",
            f"|u| must stay below {STRONGEST:g} V",
            f"{drive:.4g} V",
            "If it is in millivolts, rename it u_mV; if in units of a converter, write the factor in rig.toml: [units] u.",
        )
    for name, values in signals.items():
        if units.length != LAB.length:
            break
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
            f"If the file holds millimetres, rename it {name}_mm; if micrometres, {name}_um; if counts, write the factor in "
            f"rig.toml: [units] {'reference' if name == 'xr' else name}.",
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


def scale_warnings(
    signals: dict[str, FloatArray], quantum: dict[str, float], Ts: float, units: Units = LAB
) -> tuple[str, ...]:
    """Return notes, beginning with ``warning:``, on signals that may well be a thousand times off in unit.

    Parameters
    ----------
    signals
        In the engine's units, by name, each ndarray, shape (n,); NaN allowed.
    quantum
        Smallest step of each measured column, in its own unit; 0 where it shows none.
    Ts
        Sampling period [s].
    units
        The rig's. Bounds of a laboratory drive hold only where it is measured in V and mm.

    Returns
    -------
    tuple of str
    """
    found = []
    travels = {name: _travel(signals[name]) for name in ("x1", "x2") if name in signals}
    moved = {
        name: values
        for name, values in signals.items()
        if name in ("x1", "x2", "v1", "v2") and np.unique(values[np.isfinite(values)][:100_000]).size >= FEWEST_LEVELS
    }
    if units.length == LAB.length:
        for name in ("x1", "x2", "v1", "v2"):
            count = quantum.get(name, 0.0) * (Ts if name[0] == "v" else 1.0)
            if count > COARSEST_COUNT:
                found.append(
                    f"warning: {name} moves in steps of {count:.3g} mm: are these an encoder's counts? Write the factor to mm "
                    f'in rig.toml: [units] {name} = {{ unit = "mm", factor = 0.0044 }}'
                )
            elif 0.0 < count < FINEST_COUNT and name in moved and max(travels.values(), default=0.0) < TINY_TRAVEL * 10:
                found.append(
                    f"warning: {name} moves in steps of {count:.3g} mm: is it in metres? Name the unit, {name}_m"
                )
    if units.length == LAB.length and units.command == LAB.command and moved:
        found += _gain_warning(signals, moved, Ts)
    if len(travels) == 2 and set(travels) <= set(moved) and max(travels.values()) > CARTS_APART * min(travels.values()):
        found.append(
            f"warning: one cart travels {max(travels.values()) / min(travels.values()):.3g} times as far as the other: "
            "are x1 and x2 in the same unit?"
        )
    if 1.0 / Ts > FASTEST_RATE:
        found.append(f"warning: the sampling rate is {1.0 / Ts:.4g} Hz: is the time in the unit that its name says?")
    return tuple(found)


def _gain_warning(signals: dict[str, FloatArray], moved: dict[str, FloatArray], Ts: float) -> list[str]:
    """Return a warning where a volt moves the carts implausibly fast or slowly."""
    drive = _peak(signals["u"])
    width = max(round(WINDOW / Ts), 1)
    speeds = [0.0]
    for name, values in moved.items():
        finite = values[np.isfinite(values)]
        if finite.size <= width:
            continue
        speed = np.abs(finite[width:] - finite[:-width]) / (width * Ts) if name[0] == "x" else np.abs(finite)
        speeds.append(float(np.percentile(speed, 99.0)))
    fastest = max(speeds)
    if drive == 0.0 or fastest == 0.0:
        return []
    if 0.0 < drive < WEAKEST:
        return [f"warning: the command stays below {drive:.3g} V and yet the carts move: is u in another unit than V?"]
    gain = fastest / drive
    if SLOWEST_GAIN <= gain <= FASTEST_GAIN:
        return []
    odd = "fast" if gain > 1.0 else "slow"
    said = f"the carts move at {fastest:.3g} mm/s under {drive:.3g} V, which is {odd} for a laboratory drive"
    return [f"warning: {said}: are u and the positions or velocities in the units that their names say?"]


def check_excitation(u: FloatArray, moved: bool, units: Units, source: str) -> tuple[str, ...]:
    """Refuse a run in which nothing happens; note a constant command, or none.

    Parameters
    ----------
    u
        Command in the engine's unit, ndarray, shape (n,).
    moved
        Whether anything moves.
    units
        The rig's.
    source
        File name for messages.

    Returns
    -------
    tuple of str

    Raises
    ------
    RecordingError
        If u is zero throughout and nothing moves: such a run tells nothing about the drive.
    """
    if np.ptp(u) > 0.0:
        return ()
    if u[0] == 0.0 and moved:
        return (f"u is 0 {units.command} throughout: the carts move by themselves, as when plucked by hand",)
    if u[0] == 0.0:
        raise broken(
            source,
            "column u",
            "the drive must be excited",
            f"u is constant, 0 {units.command} throughout, and nothing moves",
            "Check the command channel, and record a square, a sine or a closed-loop run.",
        )
    return (f"u is constant at {units.of_rig(float(u[0]), 'V')[0]:.4g} {units.command}",)
