"""Gain, phase, delay and disk margin, sensitivity peak and disturbance rejection of the sampled loop, by python-control.

The loop is broken at the command (:mod:`baselines.loop_analysis.loops`). The gain margin is the *upward* one, the factor by
which the loop gain may be raised; the downward one is reported beside it, because a loop with an unstable or integrating
inside can also be lost by too little gain. The delay margin is the smallest phase margin over its frequency, among all
crossovers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, pi

import numpy as np

from baselines.loop_analysis.loops import closed_loop_response, is_stable, loop_response
from flexdrive_gym import Drive, LinearController, PControl
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in

_POINTS = 2400
_SLOWEST = 0.02


@dataclass(frozen=True)
class Margins:
    """What linear theory says of one loop.

    Attributes
    ----------
    stable
        Whether the closed loop is stable.
    crossover
        Highest frequency at which the loop gain crosses 1 [rad/s]; nan where it never does.
    gain_margin, gain_margin_down
        Factors by which the loop gain may be raised (inf: any) and lowered (0: any) [].
    gain_margin_at
        Frequency of the vibration at the upward limit [rad/s].
    phase_margin_deg
        Smallest over all crossovers [deg].
    delay_margin
        [s]; inf where the gain never crosses 1.
    disk_margin
        Balanced disk margin α: gain and phase may vary together within (2 - α)/(2 + α) … (2 + α)/(2 - α).
    sensitivity_peak
        Largest |1/(1 + L)| [].
    stiffness
        Smallest disturbance rejection: the least disturbance at the command per mm of x2 it moves, over all frequencies
        [V/mm].
    static_stiffness
        The same for a disturbance that stays; inf with integral action.

    For an unstable loop everything but ``stable`` and ``crossover`` is nan.
    """

    stable: bool
    crossover: float = field(metadata=measured_in("rad/s"))
    gain_margin: float
    gain_margin_down: float
    gain_margin_at: float = field(metadata=measured_in("rad/s"))
    phase_margin_deg: float
    delay_margin: float = field(metadata=measured_in("s"))
    disk_margin: float
    sensitivity_peak: float
    stiffness: float = field(metadata=measured_in("V/mm"))
    static_stiffness: float = field(metadata=measured_in("V/mm"))


def frequencies(drive: Drive, sample_time: float) -> FloatArray:
    """Return frequencies up to Nyquist's, denser around the resonance [rad/s], ndarray, shape (n,)."""
    wide = np.geomspace(_SLOWEST, 0.999 * pi / sample_time, _POINTS)
    around = drive.linear.omega_n
    if not np.isfinite(around):
        return wide
    return np.union1d(wide, np.linspace(0.6 * around, 1.6 * around, _POINTS // 3))


def margins(drive: Drive, controller: LinearController | PControl) -> Margins:
    """Return the margins of a controller on the linear part of a drive.

    Parameters
    ----------
    drive
        Its masses, dampers, spring and input delay count.
    controller
        A linear controller, or P-control at 1 kHz; command limit, friction compensation and shaper do not count.

    Raises
    ------
    TypeError
        For a controller that is not linear.
    """
    import control  # noqa: PLC0415  (costs a second; used here only)

    if isinstance(controller, PControl):
        controller = controller.linear()
    if not isinstance(controller, LinearController):
        raise TypeError(
            f"controller: must be a LinearController or PControl; got {type(controller).__name__}. Make one by "
            "LinearController.from_tf or from_ss, or find margins by trial: baselines.loop_analysis.empirical_margins."
        )

    omega = frequencies(drive, controller.sample_time)
    L = loop_response(drive, controller, omega)
    points = control.frd(L, omega, smooth=True)
    gm, pm, _sm, w_pc, w_gc, _w_sm = control.stability_margins(points, returnall=True)
    crossover = float(np.max(w_gc)) if len(w_gc) else float("nan")
    if not is_stable(drive, controller):
        nothing = float("nan")
        return Margins(False, crossover, *(nothing,) * 9)
    up, down = gm > 1.0, (gm < 1.0) & (gm > 0.0)
    which = int(np.argmin(np.where(up, gm, inf))) if up.any() else -1
    sensitivity = 1.0 / (1.0 + L)
    driven = closed_loop_response(drive, controller, omega)[:, drive.carts - 1, 1]
    static = abs(closed_loop_response(drive, controller, [1e-5])[0, drive.carts - 1, 1])
    return Margins(
        stable=True,
        crossover=crossover,
        gain_margin=float(gm[which]) if which >= 0 else inf,
        gain_margin_down=float(np.max(gm[down])) if down.any() else 0.0,
        gain_margin_at=float(w_pc[which]) if which >= 0 else float("nan"),
        phase_margin_deg=float(np.min(np.abs(pm))) if len(pm) else inf,
        delay_margin=delay_margin(pm, w_gc),
        # of a single loop; python-control's disk_margins calls the bound for many loops at every frequency, which takes seconds
        disk_margin=float(1.0 / np.max(np.abs(sensitivity - 0.5))),
        sensitivity_peak=float(np.max(np.abs(sensitivity))),
        stiffness=float(1.0 / np.max(np.abs(driven))),
        static_stiffness=float(1.0 / static) if static > 1e-3 * float(np.max(np.abs(driven))) else inf,
    )


def delay_margin(phase_margins: FloatArray, crossovers: FloatArray) -> float:
    """Return the smallest delay that makes a stable loop unstable [s].

    A negative phase margin at a crossover of a stable loop is 360° of lag away from instability, less itself.
    """
    if not len(crossovers):
        return inf
    lag = np.mod(np.asarray(phase_margins), 360.0)
    return float(np.min(np.deg2rad(lag) / np.asarray(crossovers)))
