"""The in-lab session, 2.1-2.6 of the handout, on a simulated drive, or on whatever bench they can be made on."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from baselines.loop_analysis.stability_limit import LARGEST_GAIN, grows, with_rig
from flexdrive_gym import Drive, Excitation, PControl, Recording
from flexdrive_gym.references import handout_trajectory, sine, square
from flexdrive_gym.units import Units

SAMPLE_TIME_S = 1e-3
DURATION_S = 8.0
P_CONTROL_S = 4.0
STABLE_GAIN = 0.05
SQUARES_V = (1.5, 2.0)
SINE_V = 2.5
FREQUENCIES_HZ = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 8.0, 12.0, 16.0, 20.0)
TRAVEL_MM = 400.0
PARTS = ("2.1", "2.2", "2.3", "2.4", "2.5", "2.6")
CRITICAL = {"2.2", "2.3", "2.4"}
# of the limit that a student finds
PRECISION = 2e-3


class Bench(Protocol):
    """Where the experiments are made, one after another: a simulated drive, or a rig (:class:`baselines.rig.RigBench`)."""

    @property
    def carts(self) -> int:
        """2, or 1 for a rigid drive."""

    @property
    def units(self) -> Units:
        """Those of its owner, for names; everything else here is on the engine's scale."""

    def p_control(self, gain: float, feedback: Literal["x1", "x2"], name: str = "") -> Recording:
        """Run P-control on the handout's trajectory for 4 s (2.1-2.4); gain in V/mm."""

    def open_loop(self, kind: Literal["square", "sine"], amplitude: float, frequency: float) -> Recording:
        """Run an open-loop excitation [V], [Hz] for 8 s (2.5, 2.6)."""


@dataclass(frozen=True)
class DriveBench:
    """A simulated drive as a bench, in one compiled call a run."""

    drive: Drive

    @property
    def carts(self) -> int:
        """2, or 1 for a rigid drive."""
        return self.drive.carts

    @property
    def units(self) -> Units:
        """The drive's."""
        return self.drive.units

    def p_control(self, gain: float, feedback: Literal["x1", "x2"], name: str = "") -> Recording:
        """See :func:`p_control`."""
        return p_control(self.drive, gain, feedback, name=name)

    def open_loop(self, kind: Literal["square", "sine"], amplitude: float, frequency: float) -> Recording:
        """See :func:`open_loop`."""
        return open_loop(self.drive, kind, amplitude, frequency)


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
        name=name or closed_loop_name(gain, feedback, drive.units),
    )
    touches = bool(np.max(np.abs(run.u)) >= rig.voltage_limit)
    excitation = replace(run.excitation, frequency=0.5, limit=rig.voltage_limit if touches else None)
    return replace(run, excitation=excitation, v1=None, v2=None)


def limit_in_the_lab(on: Drive | Bench, near: float | None = None, *, precision: float = PRECISION) -> float | None:
    """Return the gain at which four seconds of the repeating trajectory begin to grow, as a student finds it (2.2).

    It lies below :func:`~baselines.loop_analysis.stability_limit.critical_gain`: every move of the trajectory pushes the
    vibration anew, and friction holds a small vibration but not a large one.

    Parameters
    ----------
    on
        A drive or a bench; the gain rises from small ones, so that the first that grows is little beyond the limit.
    near
        Limit of a drive much like this one: the gains around it are tried first.
    precision
        Ratio of the gains between which the limit lies at the end, less 1.

    Returns
    -------
    float or None
        Kp [V/mm]; ``None`` where nothing grows below 10 V/mm.
    """
    bench = DriveBench(on) if isinstance(on, Drive) else on

    def unstable(gain: float) -> bool:
        return grows(bench.p_control(gain, "x2"))

    scan = np.geomspace(STABLE_GAIN, LARGEST_GAIN, 41)
    if near is not None and not unstable(0.6 * near):
        # as finely as the whole scan
        scan = near * np.geomspace(0.6, 1.6, 9)
    first = next((i for i, gain in enumerate(scan) if unstable(float(gain))), None)
    if first is None and near is not None:
        return limit_in_the_lab(bench, precision=precision)
    if first is None:
        return None
    if first == 0:
        return float(scan[0])
    low, high = float(scan[first - 1]), float(scan[first])
    while high > (1.0 + precision) * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return low


def open_loop(drive: Drive, kind: Literal["square", "sine"], amplitude: float, frequency: float) -> Recording:
    """Run an open-loop excitation for 8 s (2.5, 2.6); velocities are recorded as the rig makes them."""
    t = _times(DURATION_S)
    u = (square if kind == "square" else sine)(t, amplitude, frequency)
    run = with_rig(drive).simulate(t, u, name=open_loop_name(kind, amplitude, frequency, drive.units))
    return replace(run, excitation=Excitation(kind, amplitude, frequency), x1=None, x2=None)


def closed_loop_name(gain: float, feedback: str, units: Units) -> str:
    """Return the name of a P-control run; the gain as the rig's owner reads it."""
    return f"pctrl_{feedback}_kp{units.of_rig(gain, 'V/mm')[0]:.4g}"


def open_loop_name(kind: str, amplitude: float, frequency: float, units: Units) -> str:
    """Return the name of an open-loop run; figures as the rig's owner reads them."""
    size, unit = units.of_rig(amplitude, "V")
    return f"{kind}_{_short(size)}{unit.replace(' ', '')}_{_short(units.of_rig(frequency, 'Hz')[0])}Hz"


def _short(value: float) -> str:
    """Return a number for a file's name: with one decimal as on the rig, with more where two values would share a name."""
    return f"{value:.1f}" if abs(value - round(value, 1)) < 1e-9 else f"{value:.4g}"


def stability_experiments(
    on: Drive | Bench, near: float | None = None, *, precision: float = PRECISION
) -> dict[str, Recording]:
    """Run 2.1-2.4: stable, critically stable, unstable, and collocated at the unstable gain.

    Parameters
    ----------
    on, near, precision
        As in :func:`limit_in_the_lab`.

    Returns
    -------
    dict
        Section of the handout to recording. A rigid drive, or one without a limit below 10 V/mm, has 2.1 only.
    """
    bench = DriveBench(on) if isinstance(on, Drive) else on
    return dict(_stability(bench, PARTS, near, precision))


def _stability(
    bench: Bench, parts: Collection[str], near: float | None, precision: float
) -> Iterator[tuple[str, Recording]]:
    if "2.1" in parts:
        yield "2.1", bench.p_control(STABLE_GAIN, "x2" if bench.carts == 2 else "x1")
    if bench.carts == 1 or CRITICAL.isdisjoint(parts):
        return
    limit = limit_in_the_lab(bench, near, precision=precision)
    if limit is None:
        return
    # "a little above": enough to see the growth within the four seconds that are recorded
    high = 1.03 * limit
    if "2.2" in parts:
        yield "2.2", bench.p_control(limit, "x2", f"{closed_loop_name(limit, 'x2', bench.units)}_critical")
    if "2.3" in parts:
        yield "2.3", bench.p_control(high, "x2", f"{closed_loop_name(high, 'x2', bench.units)}_unstable")
    if "2.4" in parts:
        yield "2.4", bench.p_control(high, "x1", f"{closed_loop_name(high, 'x1', bench.units)}_collocated")


def lab_session(
    bench: Bench,
    *,
    squares: Sequence[float] = SQUARES_V,
    sine_amplitude: float = SINE_V,
    frequencies: Sequence[float] = FREQUENCIES_HZ,
    parts: Collection[str] = PARTS,
    near: float | None = None,
    precision: float = PRECISION,
) -> Iterator[Recording]:
    """Yield every recording of 2.1-2.6, one at a time.

    Parameters
    ----------
    bench
        Where they are made.
    squares
        Amplitudes of the 0.5 Hz squares [V].
    sine_amplitude, frequencies
        Of the sines [V], [Hz].
    parts
        Sections of the handout to make; 2.3 and 2.4 also need the search of 2.2.
    near, precision
        As in :func:`limit_in_the_lab`.
    """
    for _part, made in _stability(bench, parts, near, precision):
        yield made
    if "2.5" in parts:
        for amplitude in squares:
            yield bench.open_loop("square", amplitude, 0.5)
    if "2.6" in parts:
        for frequency in frequencies:
            yield bench.open_loop("sine", sine_amplitude, frequency)
