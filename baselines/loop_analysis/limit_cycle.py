r"""The margin that depends on amplitude: dry friction and the command limit by their describing functions.

Let cart 2 vibrate as :math:`x_2 = X \sin\omega t` in a loop whose command is scaled by g. Coulomb friction answers a sine of
velocity V as a damper :math:`N = 4d/(\pi V)`, so with the impedances of :mod:`identification.theoretical_response`

.. math::
   V_1 = (Z_2 + N_2) V_2 / Z_{12}, \qquad U = (Z_1 + N_1) V_1 - Z_{12} V_2, \qquad
   U = g\,R(j\omega)\,(K_1 X_1 + K_2 X_2),

where :math:`K_1, K_2` are the controller's gains from the readings and R the lag of hold and input delay. For every amplitude X
one frequency makes g real: at that g the vibration keeps its size, below it dies, above it grows. As X grows g falls to the
linear gain margin; where the vibration is so small that friction holds it, g is large. That is why a rig withstands gains
above Routh's, and why it depends on the push. A command limit lets only :math:`4 u_{max}/\pi` of fundamental through, so beyond
some amplitude g rises again: an unstable loop on the rig ends in a vibration between the limits.

The method assumes that the motion is nearly a sine and the carts never stick; :func:`simulated_limit` tries the same
amplitudes on the simulated drive.

Reference: A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, ch. 2 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from baselines.loop_analysis.loops import response
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.recording import FloatArray

_LOWEST, _HIGHEST = 0.3, 4.0
_GRID = 240
_TRIAL_S = 6.0


@dataclass(frozen=True)
class LimitCycle:
    """A vibration that keeps its size.

    Attributes
    ----------
    amplitude
        Of x2 [mm].
    factor
        On the command []; for a P-controller of gain Kp the critical gain is factor·Kp. inf where no factor sustains it.
    omega
        [rad/s]
    states
        x1, v1, x2, v2 at x2 = 0 on its way up [mm], [mm/s].
    """

    amplitude: float
    factor: float
    omega: float
    states: tuple[float, float, float, float]


def limit_cycle(drive: Drive, controller: LinearController, amplitude: float, *, limit: float = inf) -> LimitCycle:
    """Return the factor on the command at which a vibration of x2 keeps its size, by harmonic balance.

    Parameters
    ----------
    drive
        With two carts; masses, dampers, spring, Coulomb levels and input delay count.
    controller
        Its linear part counts.
    amplitude
        Of x2 [mm].
    limit
        Of the command [V].

    Raises
    ------
    ValueError
        For a rigid drive or an amplitude that is not positive.
    """
    if drive.carts != 2 or not amplitude > 0.0:
        raise ValueError(
            f"amplitude: needs two carts and a positive amplitude [mm]; got {drive.carts} and {amplitude:g}."
        )
    around = drive.linear.omega_n
    grid = np.geomspace(_LOWEST * around, _HIGHEST * around, _GRID)
    ratio = np.array([_factor(drive, controller, float(w), amplitude) for w in grid])
    best = LimitCycle(amplitude, inf, float("nan"), (0.0, 0.0, 0.0, 0.0))
    for i in np.flatnonzero((ratio.imag[:-1] > 0.0) != (ratio.imag[1:] > 0.0)):
        if abs(np.angle(ratio[i]) - np.angle(ratio[i + 1])) > 1.0:  # a jump through infinity is no crossing
            continue
        omega = float(brentq(lambda w: _factor(drive, controller, w, amplitude).imag, grid[i], grid[i + 1]))
        factor = _factor(drive, controller, omega, amplitude).real
        if 0.0 < factor < best.factor:
            v1, v2, u = _phasors(drive, omega, amplitude)
            needed = abs(u)
            best = LimitCycle(amplitude, factor * _through_limit(needed, limit), omega, _states(v1, v2, omega))
    return best


def _states(v1: complex, v2: complex, omega: float) -> tuple[float, float, float, float]:
    x1 = v1 / (1j * omega)
    # x2 is the sine's phasor -j·X: at t = 0 it passes zero upwards with velocity ωX, and v2 is real
    return float(x1.real), float(v1.real), 0.0, float(v2.real)


def _phasors(drive: Drive, omega: float, amplitude: float) -> tuple[complex, complex, complex]:
    """Return V1, V2 [mm/s] and the force's phasor U [V] for a vibration of x2; V2 is real."""
    v2 = complex(omega * amplitude)
    coupling = drive["C"] + drive["k"] / (1j * omega)
    z1 = 1j * omega * drive["m1"] + drive["b1"] + coupling
    z2 = 1j * omega * drive["m2"] + drive["b2"] + coupling
    v1 = (z2 + 4.0 * drive["d2"] / (pi * abs(v2))) * v2 / coupling
    u = (z1 + 4.0 * drive["d1"] / (pi * abs(v1))) * v1 - coupling * v2
    return v1, v2, u


def _factor(drive: Drive, controller: LinearController, omega: float, amplitude: float) -> complex:
    """Return g: the force a vibration needs over the force the controller's command makes of it."""
    v1, v2, u = _phasors(drive, omega, amplitude)
    c, Ts = controller, controller.sample_time
    K = response(c.A, c.B, c.C[:1], c.D[:1], [omega], Ts)[0, 0]
    hold = np.sinc(omega * Ts / (2.0 * pi)) * np.exp(-1j * omega * (0.5 * Ts + drive["input_delay.tau"]))
    made = hold * (K[1] * v1 + K[2] * v2) / (1j * omega)
    return complex(u / made)


def _through_limit(needed: float, limit: float) -> float:
    """Return by how much a command must be raised for its fundamental behind the limit to be ``needed`` [V]; inf if it cannot."""
    if needed <= limit:
        return 1.0
    if needed >= 4.0 * limit / pi:
        return inf

    def fundamental(amplitude: float) -> float:
        ratio = limit / amplitude
        return float(amplitude * 2.0 / pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2)))

    return float(brentq(lambda a: fundamental(a) - needed, limit, 1e6 * limit)) / needed


def limit_cycle_curve(
    drive: Drive, controller: LinearController, amplitudes: npt.ArrayLike, *, limit: float = inf
) -> list[LimitCycle]:
    """Return :func:`limit_cycle` for every amplitude [mm]."""
    return [limit_cycle(drive, controller, float(a), limit=limit) for a in np.asarray(amplitudes)]


def simulated_limit(drive: Drive, controller: LinearController, start: LimitCycle, *, precision: float = 2e-3) -> float:
    """Return the factor on the command at which a vibration of this size begins to grow on the simulated drive.

    The drive starts in the state that harmonic balance predicts, with the controller already in that vibration: it runs in with
    the reference at rest, which a static controller does at once. Growing is judged on the swing of x2 within 6 s against the
    swing it starts with.

    Parameters
    ----------
    start
        From :func:`limit_cycle`.

    Returns
    -------
    float
        inf where 5 times the linear prediction does not grow.
    """
    Ts = controller.sample_time
    n = round(_TRIAL_S / Ts)
    free = controller.replace(shaper=((0, 1.0),), friction=0.0)

    def grows(factors: FloatArray) -> npt.NDArray[np.bool_]:
        out = run_batch([drive] * len(factors), np.zeros(n), free, gains=factors, start=start.states)
        swing = np.ptp(out[:, 2, n // 2 :], axis=1)
        return np.asarray(~(swing <= 2.0 * start.amplitude))  # nan is a motion that left all bounds

    middle = start.factor if np.isfinite(start.factor) else 1.0
    low, high = 0.2 * middle, 5.0 * middle
    if not grows(np.array([high]))[0]:
        return inf
    while high > low * (1.0 + precision):
        inner = np.geomspace(low, high, 10)[1:-1]
        hit = grows(inner)
        i = int(np.argmax(hit)) if hit.any() else len(inner)
        low, high = (float(inner[i - 1]) if i else low), (float(inner[i]) if i < len(inner) else high)
    return float(np.sqrt(low * high))
