"""The in-lab session, 2.1-2.6 of the handout, on a simulated rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from baselines.loop_analysis.stability_limit import LARGEST_GAIN, grows, with_rig
from flexdrive_gym import Drive, Excitation, PControl, Recording
from flexdrive_gym.references import handout_trajectory, sine, square

SAMPLE_TIME_S = 1e-3
DURATION_S = 8.0
P_CONTROL_S = 4.0
STABLE_GAIN = 0.05
SQUARES_V = (1.5, 2.0)
SINE_V = 2.5
FREQUENCIES_HZ = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 8.0, 12.0, 16.0, 20.0)
TRAVEL_MM = 400.0


def _times(duration: float) -> np.ndarray:
    return np.arange(round(duration / SAMPLE_TIME_S) + 1) * SAMPLE_TIME_S


def p_control(
    drive: Drive, gain: float, feedback: Literal["x1", "x2"], *, duration: float = P_CONTROL_S, name: str = ""
) -> Recording:
    """Run P-control on the handout's trajectory (2.1-2.4).

    Parameters
    ----------
    drive
        The rig; encoder counts and the command limit are the handout's where it has none.
    gain
        Kp [V/mm].
    feedback
        ``x2`` (non-collocated) or ``x1`` (collocated).
    duration
        [s]
    """
    t = _times(duration)
    rig = with_rig(drive)
    run = rig.simulate_closed_loop(
        t,
        handout_trajectory(t),
        PControl(gain, feedback),
        travel_limit=TRAVEL_MM,
        name=name or _p_name(drive, gain, feedback),
    )
    touches = bool(np.max(np.abs(run.u)) >= rig.voltage_limit)
    excitation = replace(run.excitation, frequency=0.5, limit=rig.voltage_limit if touches else None)
    return replace(run, excitation=excitation, v1=None, v2=None)


def _p_name(drive: Drive, gain: float, feedback: str) -> str:
    return f"pctrl_{feedback}_kp{drive.units.of_rig(gain, 'V/mm')[0]:.4g}"


def limit_in_the_lab(drive: Drive, near: float | None = None) -> float | None:
    """Return the gain at which four seconds of the repeating trajectory begin to grow, as a student finds it (2.2).

    It lies below :func:`~baselines.loop_analysis.stability_limit.critical_gain`: every move of the trajectory pushes the
    vibration anew, and friction holds a small vibration but not a large one.

    Parameters
    ----------
    near
        Limit of a drive much like this one: the gains around it are tried first.

    Returns
    -------
    float or None
        Kp [V/mm], to 0.2 %; ``None`` where nothing grows below 10 V/mm.
    """
    scan = np.geomspace(STABLE_GAIN, LARGEST_GAIN, 41)
    if near is not None and not grows(p_control(drive, 0.6 * near, "x2")):
        # as finely as the whole scan
        scan = near * np.geomspace(0.6, 1.6, 9)
    first = next((i for i, gain in enumerate(scan) if grows(p_control(drive, float(gain), "x2"))), None)
    if first is None and near is not None:
        return limit_in_the_lab(drive)
    if first is None:
        return None
    if first == 0:
        return float(scan[0])
    low, high = float(scan[first - 1]), float(scan[first])
    while high > 1.002 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if grows(p_control(drive, middle, "x2")) else (middle, high)
    return low


def open_loop(drive: Drive, kind: Literal["square", "sine"], amplitude: float, frequency: float) -> Recording:
    """Run an open-loop excitation for 8 s (2.5, 2.6); velocities are recorded as the rig makes them."""
    t = _times(DURATION_S)
    u = (square if kind == "square" else sine)(t, amplitude, frequency)
    size, unit = drive.units.of_rig(amplitude, "V")
    name = f"{kind}_{_short(size)}{unit.replace(' ', '')}_{_short(drive.units.of_rig(frequency, 'Hz')[0])}Hz"
    run = with_rig(drive).simulate(t, u, name=name)
    return replace(run, excitation=Excitation(kind, amplitude, frequency), x1=None, x2=None)


def _short(value: float) -> str:
    """Return a number for a file's name: with one decimal as on the rig, with more where two values would share a name."""
    return f"{value:.1f}" if abs(value - round(value, 1)) < 1e-9 else f"{value:.4g}"


def stability_experiments(drive: Drive) -> dict[str, Recording]:
    """Run 2.1-2.4: stable, critically stable, unstable, and collocated at the unstable gain.

    Returns
    -------
    dict
        Section of the handout to recording. A rigid drive, or one without a limit below 10 V/mm, has 2.1 only.
    """
    feedback: Literal["x1", "x2"] = "x2" if drive.carts == 2 else "x1"
    runs = {"2.1": p_control(drive, STABLE_GAIN, feedback)}
    limit = limit_in_the_lab(drive) if drive.carts == 2 else None
    if limit is not None:
        # "a little above": enough to see the growth within the four seconds that are recorded
        unstable = 1.03 * limit
        runs["2.2"] = p_control(drive, limit, "x2", name=f"{_p_name(drive, limit, 'x2')}_critical")
        runs["2.3"] = p_control(drive, unstable, "x2", name=f"{_p_name(drive, unstable, 'x2')}_unstable")
        runs["2.4"] = p_control(drive, unstable, "x1", name=f"{_p_name(drive, unstable, 'x1')}_collocated")
    return runs


def lab_day(
    drive: Drive,
    *,
    squares: Sequence[float] = SQUARES_V,
    sine_amplitude: float = SINE_V,
    frequencies: Sequence[float] = FREQUENCIES_HZ,
) -> Iterator[Recording]:
    """Yield every recording of 2.1-2.6, one at a time.

    Parameters
    ----------
    drive
        The rig.
    squares
        Amplitudes of the 0.5 Hz squares [V].
    sine_amplitude, frequencies
        Of the sines [V], [Hz].
    """
    yield from stability_experiments(drive).values()
    for amplitude in squares:
        yield open_loop(drive, "square", amplitude, 0.5)
    for frequency in frequencies:
        yield open_loop(drive, "sine", sine_amplitude, frequency)
