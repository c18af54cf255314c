r"""The computations of handout 3.2, step by step: steady-state line, real pole and its bias, Steps 1-6.

**Steady velocity.** Eq. (5), :math:`v_{ss} = (u_0 - d_T)/b_T`, on two amplitudes gives :math:`b_T` and :math:`d_T`; on
more, the least squares line through :math:`(u_0, v_{ss})` does.

**Real pole.** The handout reads the time constant off v1 as the time to 63.2 % of the output range, from
:math:`-v_{ss}` to :math:`+v_{ss}`, as on a first-order system: :math:`p = 1/t_{63}`. Coulomb friction makes that
reading too short. A rigid drive reversed by :math:`-u_0 \to +u_0` obeys, with :math:`p = b_T/m_T`,

.. math::
   m_T \dot v = u_0 + d_T - b_T v \quad (v < 0), \qquad m_T \dot v = u_0 - d_T - b_T v \quad (v > 0),

because friction helps to stop the drive before it hinders its start. From :math:`-v_{ss}` the velocity rises towards
:math:`(u_0 + d_T)/b_T` and crosses zero at :math:`t_0 = \frac1p \ln\frac{2 u_0}{u_0 + d_T}`; from there
:math:`v = v_{ss}(1 - e^{-p(t - t_0)})`, which reaches the level :math:`-v_{ss} + (1 - e^{-1}) 2 v_{ss} = (1 - 2/e) v_{ss}`
a time :math:`\frac1p(1 - \ln 2)` later. Together

.. math::
   t_{63} = \frac{1}{p} \left(1 - \ln\left(1 + \frac{d_T}{u_0}\right)\right),

so the scalar equation for the true p has the solution :math:`p = (1 - \ln(1 + d_T/u_0))/t_{63}`, and the handout's p is
too large by the factor :math:`1/(1 - \ln(1 + d_T/u_0))` whatever :math:`b_T` is. The handout's quantities follow from the
biased reading; the corrected p stands beside them, and ``p=`` takes it (3.3's slight adjustment).

**Vibration.** :math:`\omega_d` is read from successive extrema of v2; :math:`\zeta`, :math:`\omega_n` and k follow from
Steps 1-6. See :mod:`identification.half_periods` for averaging and reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import e, log, sqrt

import numpy as np
from scipy.optimize import brentq

from flexdrive_gym import Drive, LinearDrive
from flexdrive_gym.recording import FloatArray
from identification.half_periods import AmplitudeReading, rise_time, standard_error

# 63.2 % of the way from -vss to +vss, as a fraction of vss
LEVEL_63 = 1.0 - 2.0 / e
# of the simulated reading [s]
_SIMULATION_STEP = 1e-3
# Step 1 tries 0.01 ... 0.20
_FIRST_ZETA = 0.05
_ZETA_TOLERANCE = 1e-6
# a heavily damped pair converges slowly
_MOST_ITERATIONS = 1000
# friction below this share of the smallest amplitude is zero as far as Eq. (5) can tell
_NO_FRICTION = 0.02


@dataclass(frozen=True)
class TimeConstantReading:
    """The 63 % reading on v1 and its bias under Coulomb friction.

    Attributes
    ----------
    amplitude
        u0 [V] of the reading: the largest.
    vss, level
        Steady velocity and the level read at, -vss + 63.2 % of 2·vss [mm/s].
    t63, t63_error
        Time from reversal to the level [s], and its standard error over half-periods.
    p_read, p_corrected
        1/t63, and the real pole of the rigid drive with Coulomb friction that has this t63 [1/s].
    bias_percent
        By how much ``p_read`` is above ``p_corrected``.
    p_consistent
        The p with which the whole two-cart drive of 3.2, simulated with its Coulomb friction, has this t63 [1/s]; the
        spring's share of the bias is in it too. ``None`` where there is no such p.
    """

    amplitude: float
    vss: float
    level: float
    t63: float
    t63_error: float | None
    p_read: float
    p_corrected: float
    bias_percent: float
    p_consistent: float | None = None

    @property
    def p_error(self) -> float | None:
        """Standard error of ``p_read`` [1/s]."""
        return None if self.t63_error is None else self.t63_error / self.t63 * self.p_read


@dataclass(frozen=True)
class ZetaIteration:
    """One pass of Steps 1-6: ζ assumed, ωn [rad/s], k [V/mm], and ζ of the poles found with them."""

    zeta: float
    omega_n: float
    k: float
    zeta_of_poles: float


def time_to_63_percent(u0: float, dT: float, bT: float, p: float) -> float:
    """Return the exact 63 % reading [s] of a rigid drive with Coulomb friction reversed from -u0 to +u0.

    Parameters
    ----------
    u0, dT
        Command amplitude and total Coulomb friction [V], ``0 <= dT < u0``.
    bT
        Total viscous friction [V s/mm]; it scales the velocity only and drops out.
    p
        Real pole, bT/mT [1/s].

    Raises
    ------
    ValueError
        If the drive would not move, or a value is not positive.
    """
    if not (0.0 <= dT < u0 and bT > 0.0 and p > 0.0):
        raise ValueError(
            f"u0, dT, bT, p: must satisfy 0 <= dT < u0, bT > 0, p > 0; got u0 = {u0:g}, dT = {dT:g}, "
            f"bT = {bT:g}, p = {p:g}. A drive with dT >= u0 does not move: use a larger amplitude."
        )
    return (1.0 - log(1.0 + dT / u0)) / p


def steady_state_line(used: Sequence[AmplitudeReading]) -> tuple[float, float, FloatArray | None]:
    """Return bT [V s/mm], dT [V] of Eq. (5), and their covariance from the standard errors of vss, shape (2, 2)."""
    u0 = np.array([reading.amplitude for reading in used])
    vss = np.array([reading.vss for reading in used])
    # vss = slope·u0 + intercept: vss carries the error, u0 is exact; two points are met exactly
    design = np.column_stack([u0, np.ones_like(u0)])
    solve = np.linalg.pinv(design)
    slope, intercept = solve @ vss
    units = used[0].units
    listed = ", ".join(f"{units.text(v, 'mm/s')} at ±{units.text(u, 'V')}" for u, v in zip(u0, vss, strict=True))
    if not slope > 0.0:
        raise ValueError(
            f"recordings: the steady velocity must rise with the amplitude for Eq. (5) to give bT > 0; got {listed}. "
            "Friction changed between the runs: record both amplitudes again in turn, several times, on a warm rig."
        )
    bT, dT = float(1.0 / slope), float(-intercept / slope)
    covariance = None
    errors = [reading.vss_error for reading in used]
    if all(error is not None for error in errors):
        of_line = solve @ np.diag(np.square(np.array(errors, dtype=np.float64))) @ solve.T
        jacobian = np.array([[-(bT**2), 0.0], [intercept * bT**2, -bT]])
        covariance = np.asarray(jacobian @ of_line @ jacobian.T)
    spread = 2.0 * sqrt(covariance[1, 1]) if covariance is not None else 0.0
    if dT < -max(_NO_FRICTION * u0[0], spread):
        raise ValueError(
            f"recordings: Eq. (5) must give dT >= 0; got dT = {units.text(dT, 'V', 3)} from {listed}. The amplitudes "
            "were recorded under different friction, or one file's amplitude is wrong: check u, and record both in turn."
        )
    return bT, dT, covariance


def read_time_constant(reading: AmplitudeReading, dT: float) -> TimeConstantReading:
    """Read the 63 % time off the averaged v1, and state its bias for a total Coulomb friction dT [V].

    Raises
    ------
    ValueError
        If v1 does not rise through the level after the reversal.
    """
    level, units = LEVEL_63 * reading.vss, reading.units
    t63 = rise_time(reading.t, reading.v1, level)
    if not t63 > 0.0:
        raise ValueError(
            f"recordings: v1 at ±{units.text(reading.amplitude, 'V')} must rise through {units.text(level, 'mm/s', 3)} after the "
            "reversal; got a "
            f"crossing at {1e3 * t63:.3g} ms. Check that v1 belongs to the driven cart and has the sign of u."
        )
    times = [rise_time(half.t, half.v1, level) for half in reading.half_periods]
    each = [time for time in times if np.isfinite(time)]
    # beyond dT = u0 the drive would not move; the line's dT is below every amplitude that moves, but only just at times
    factor = time_to_63_percent(reading.amplitude, min(dT, 0.999 * reading.amplitude), 1.0, 1.0)
    return TimeConstantReading(
        amplitude=reading.amplitude,
        vss=reading.vss,
        level=level,
        t63=t63,
        t63_error=standard_error(each),
        p_read=1.0 / t63,
        p_corrected=factor / t63,
        bias_percent=100.0 * (1.0 / factor - 1.0),
    )


def consistent_p(
    time_constant: TimeConstantReading, bT: float, dT: float, drive_for: Callable[[float], Drive], half_period: float
) -> float | None:
    """Return the p [1/s] with which the simulated two-cart drive has the t63 that was read; ``None`` if there is none.

    A spring lets cart 1 run ahead of cart 2, so v1 reaches 63 % before the two together would. How much earlier depends
    on everything identified, so it is found by simulating the drive that 3.2 gives for p and reading it the same way.

    Parameters
    ----------
    time_constant
        The reading on the rig.
    bT, dT
        Of Eq. (5) [V s/mm], [V].
    drive_for
        Makes the drive of 3.2 for a p.
    half_period
        Of the square wave [s].
    """
    u0, level = time_constant.amplitude, LEVEL_63 * (time_constant.amplitude - dT) / bT
    # the third half-period: the first starts from rest, the second still remembers it
    samples = round(half_period / _SIMULATION_STEP)
    t = _SIMULATION_STEP * np.arange(3 * samples)
    u = u0 * np.repeat([1.0, -1.0, 1.0], samples)
    since: FloatArray = np.asarray(t[:samples] - 0.5 * _SIMULATION_STEP, dtype=np.float64)

    def excess(log_p: float) -> float:
        v1 = drive_for(float(np.exp(log_p))).simulate(t, u).v1
        assert v1 is not None
        return rise_time(since, v1[2 * samples :], level) - time_constant.t63

    # slower drives than a sixth of the reading ring through the level twice and jump
    low, high = log(time_constant.p_read / 6.0), log(time_constant.p_read)
    try:
        return float(np.exp(brentq(excess, low, high, xtol=1e-4)))
    except ValueError:  # no change of sign, or Steps 1-6 fail at an end
        return None


def iterate_zeta(
    m1: float, m2: float, b1: float, b2: float, omega_d: float, *, first: float = _FIRST_ZETA
) -> tuple[ZetaIteration, ...]:
    """Iterate Steps 1-6 of handout 3.2 until ζ changes by less than 1e-6 of itself.

    Parameters
    ----------
    m1, m2
        Masses [V s²/mm].
    b1, b2
        Dampers [V s/mm].
    omega_d
        Damped natural frequency read from v2 [rad/s].
    first
        Step 1's guess of ζ.

    Returns
    -------
    tuple of ZetaIteration
        Every pass; the last one is converged.

    Raises
    ------
    ValueError
        If the drive so built does not oscillate, or ζ does not converge.
    """
    table: list[ZetaIteration] = []
    zeta = first  # Step 1
    for _ in range(_MOST_ITERATIONS):
        omega_n = omega_d / sqrt(1.0 - zeta**2)  # Step 2
        k = m1 * m2 * omega_n**2 / (m1 + m2)  # Step 3
        poles = LinearDrive(m1, m2, b1, b2, k).poles  # Steps 4 and 5
        pair = poles[poles.imag > 0.0]
        if not len(pair):
            raise ValueError(
                f"p: Steps 1-6 need a complex pair of poles; got real ones alone for p = {(b1 + b2) / (m1 + m2):.3g} 1/s. "
                "The masses bT/p are too small for the vibration observed: pass a smaller p."
            )
        found = float(-pair[0].real / abs(pair[0]))
        table.append(ZetaIteration(zeta, omega_n, k, found))
        if abs(found - zeta) <= _ZETA_TOLERANCE * found:  # Step 6
            return tuple(table)
        zeta = found
    raise ValueError(
        f"p: ζ must converge within {_MOST_ITERATIONS} passes of Steps 1-6; got {zeta:.4g} still changing for "
        f"p = {(b1 + b2) / (m1 + m2):.3g} 1/s. Pass a smaller p."
    )


def quantities_from(
    readings: FloatArray, alpha: float, beta: float, gamma: float
) -> tuple[dict[str, float], tuple[ZetaIteration, ...]]:
    """Return the quantities of 3.5 from the four readings bT, dT, p, ωd, and the table of Steps 1-6."""
    bT, dT, p, omega_d = (float(x) for x in readings)
    mT = bT / p  # Eq. (6)
    m1, b1, d1 = mT / (1.0 + alpha), bT / (1.0 + beta), dT / (1.0 + gamma)
    table = iterate_zeta(m1, alpha * m1, b1, beta * b1, omega_d)
    last = table[-1]
    values = {
        "bT": bT, "b1": b1, "b2": beta * b1,
        "dT": dT, "d1": d1, "d2": gamma * d1,
        "p": p, "mT": mT, "m1": m1, "m2": alpha * m1,
        "omega_d": omega_d, "k": last.k, "zeta": last.zeta_of_poles, "omega_n": last.omega_n, "C": 0.0,
    }  # fmt: skip
    return values, table


def propagated(
    chain: Callable[[FloatArray], dict[str, float]],
    readings: FloatArray,
    line_covariance: FloatArray | None,
    p_error: float | None,
    omega_d_error: float | None,
) -> dict[str, float | None]:
    """Carry the readings' standard errors over to the quantities by the delta method; None where one is unknown."""
    variances = (p_error, omega_d_error)
    known = [line_covariance is not None] * 2 + [error is not None for error in variances]
    covariance = np.zeros((4, 4))
    if line_covariance is not None:
        covariance[:2, :2] = line_covariance
    for i, error in enumerate(variances, start=2):
        covariance[i, i] = error**2 if error is not None else 0.0
    centre = chain(readings)
    columns = []
    for i, x in enumerate(readings):
        moved = readings.copy()
        moved[i] += 1e-3 * max(abs(x), 1e-3)  # coarse against the tolerance of ζ
        there = chain(moved)
        columns.append({name: (there[name] - centre[name]) / (moved[i] - x) for name in centre})
    result: dict[str, float | None] = {}
    for name in centre:
        row = np.array([column[name] for column in columns])
        needs_unknown = any(abs(row[i]) > 0.0 and not known[i] for i in range(4))
        error = sqrt(max(0.0, float(row @ covariance @ row)))
        result[name] = None if needs_unknown or error == 0.0 else error
    return result
