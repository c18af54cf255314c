r"""The collocated PD with its reference shaped, so that the vibration it leaves is not excited in the first place.

A zero-vibration shaper sends the reference in two parts, the second half a period of the vibration later: their vibrations
cancel.
For the closed loop's mode of frequency :math:`\omega_d` and damping :math:`\zeta` the parts are :math:`1/(1+K)` and
:math:`K/(1+K)`, :math:`K = e^{-\zeta\pi/\sqrt{1-\zeta^2}}` (N. C. Singer, W. P. Seering, ASME J. Dyn. Syst. Meas. Control 112,
1990). The price is a reference that comes later by a quarter of a period on average.
"""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np

from baselines.controllers._design import Design, Family, needs_two_carts
from baselines.controllers.pd import FAMILIES as PD
from baselines.loop_analysis.loops import closed_loop_matrices
from flexdrive_gym import Drive, LinearController


def dominant_mode(drive: Drive, controller: LinearController) -> tuple[float, float]:
    """Return ωd [rad/s] and ζ of the closed-loop mode that the reference excites most in x2.

    Raises
    ------
    ValueError
        If nothing oscillates.
    """
    A, both, outputs, _D = closed_loop_matrices(drive, controller)
    B, C = both[:, 0], outputs[drive.carts - 1]
    values, vectors = np.linalg.eig(A)
    weight = np.abs((C @ vectors) * np.linalg.solve(vectors, B.astype(complex)))
    s = np.log(values.astype(complex) + 1e-300) / controller.sample_time
    chosen = np.flatnonzero((s.imag > 1.0) & (s.imag < 0.5 * pi / controller.sample_time))
    if not len(chosen):
        raise ValueError("controller: its closed loop has no oscillating mode to shape for; every pole is real.")
    # residue over decay: the area of what the mode leaves behind
    best = chosen[int(np.argmax(weight[chosen] / np.abs(s.real[chosen])))]
    return float(s[best].imag), float(-s[best].real / abs(s[best]))


def zero_vibration(omega_d: float, zeta: float, sample_time: float) -> tuple[tuple[int, float], ...]:
    """Return the shaper's (delay in samples, weight); a delay between samples is shared by its neighbours."""
    K = exp(-zeta * pi / sqrt(1.0 - zeta**2))
    delay = pi / omega_d / sample_time
    whole, rest = int(delay), delay - int(delay)
    second = K / (1.0 + K)
    return (0, 1.0 / (1.0 + K)), (whole, (1.0 - rest) * second), (whole + 1, rest * second)


def _design(drive: Drive, sample_time: float) -> Design:
    needs_two_carts(drive, "pd_shaped")
    pd = PD[0].made(drive, sample_time)
    omega_d, zeta = dominant_mode(drive, pd.controller)
    shaper = zero_vibration(omega_d, zeta, sample_time)
    values = {**pd.values, "ωd": (omega_d, "rad/s"), "ζ": (zeta, "–"), "second part": (1.0 - shaper[0][1], "–"),
              "delay": (pi / omega_d, "s")}  # fmt: skip
    return Design(pd.controller.replace(shaper=shaper, name="pd_shaped"), "PD from x1, reference shaped", "x1", values)


FAMILIES = (Family("pd_shaped", "PD from x1 with a zero-vibration shaper on the reference", _design, ("x1",)),)
