r"""Frequency response in theory: linear (Eq. (7)), and quasi-linear with Coulomb friction by its describing function.

To a sinusoidal velocity of amplitude :math:`|V|` Coulomb friction answers with a square wave of height d in phase with
it, whose fundamental is :math:`4d/\pi` for every amplitude: it acts as a damper :math:`N = 4d/(\pi |V|)`. Harmonic
balance of the two carts at the command :math:`U \sin\omega t`, with the mechanical impedances
:math:`Z_1 = j\omega m_1 + b_1 + C + k/(j\omega)`, :math:`Z_2 = j\omega m_2 + b_2 + C + k/(j\omega)` and
:math:`Z_{12} = C + k/(j\omega)`, reads

.. math::
   (Z_1 + N_1) V_1 - Z_{12} V_2 = U, \qquad (Z_2 + N_2) V_2 = Z_{12} V_1 .

It is solved exactly, without iterating on N. The second equation in amplitudes,
:math:`|Z_2 |V_2| + 4 d_2/\pi| = |Z_{12}||V_1|`, is a quadratic in :math:`|V_2|`; cart 2 sticks where the right-hand side
is below :math:`4 d_2/\pi`. With :math:`V_2` so eliminated the first is one scalar equation in :math:`|V_1|`. Its operator
is strictly monotone (masses and spring are lossless, friction and dampers only dissipate), so the root exists and is
unique; for :math:`U \le 4 d_1/\pi` it is zero, the drive sticks. A real drive still creeps a little between d and
:math:`4d/\pi`, where the motion is far from a sine.

Reference: A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, ch. 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from flexdrive_gym import Drive, LinearDrive
from flexdrive_gym.recording import FloatArray

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Response:
    """Frequency response of both velocities to the command.

    Attributes
    ----------
    omega
        Frequencies [rad/s], ndarray, shape (n,).
    v1, v2
        Complex v1/u and v2/u [(mm/s)/V], ndarray, shape (n,); ``v2`` is nan for a rigid drive, both are 0 where the
        cart sticks.
    """

    omega: FloatArray
    v1: ComplexArray
    v2: ComplexArray

    def gain(self, cart: int) -> FloatArray:
        """Return the gain of cart 1 or 2 [(mm/s)/V], ndarray, shape (n,)."""
        return np.asarray(np.abs(self.v1 if cart == 1 else self.v2))

    def phase(self, cart: int) -> FloatArray:
        """Return the unwrapped phase of cart 1 or 2 [deg], ndarray, shape (n,); nan where the cart does not move."""
        values = self.v1 if cart == 1 else self.v2
        result = np.full(len(values), np.nan)
        moving = np.abs(values) > 0.0
        result[moving] = np.rad2deg(np.unwrap(np.angle(values[moving])))
        return result


def handout_frequencies() -> FloatArray:
    """Return the handout's frequencies for Bode plots: 10^-1 ... 10^3 rad/s, ndarray, shape (1000,)."""
    return np.logspace(-1.0, 3.0, 1000)


def theoretical_response(linear: LinearDrive, omega: npt.ArrayLike | None = None) -> Response:
    """Return sG1 and sG2 of Eq. (7), Coulomb friction neglected as in handout 3.4.

    Parameters
    ----------
    linear
        The linear drive.
    omega : array_like, shape (n,)
        Frequencies [rad/s]; :func:`handout_frequencies` by default.
    """
    w = handout_frequencies() if omega is None else np.asarray(omega, dtype=np.float64)
    v1 = linear.frequency_response(w, "x1")
    v2 = np.full(len(w), np.nan + 0j) if linear.rigid else linear.frequency_response(w, "x2")
    return Response(w, v1, v2)


def response_with_friction(drive: Drive, omega: npt.ArrayLike, amplitude: float) -> Response:
    """Return the quasi-linear response at one command amplitude, with Coulomb friction as describing function.

    Parameters
    ----------
    drive
        Its masses, dampers, spring and Coulomb levels d1, d2; other effects are not considered.
    omega : array_like, shape (n,)
        Frequencies [rad/s], positive.
    amplitude
        Of the sinusoidal command [V].

    Returns
    -------
    Response
        Zero where the drive sticks.

    Raises
    ------
    ValueError
        If amplitude or a frequency is not positive.
    """
    w = np.asarray(omega, dtype=np.float64)
    if not amplitude > 0.0 or not (w > 0.0).all():
        raise ValueError(
            f"amplitude, omega: must be positive [V], [rad/s]; got amplitude = {amplitude:g}, smallest omega = "
            f"{w.min():g}. Pass the amplitude of the sine command."
        )
    solved = np.array([_balance(drive, float(x), amplitude) for x in w], dtype=np.complex128).reshape(len(w), 2)
    return Response(w, solved[:, 0] / amplitude, solved[:, 1] / amplitude)


def _balance(drive: Drive, omega: float, amplitude: float) -> tuple[complex, complex]:
    """Return the phasors V1, V2 [mm/s] relative to the command's."""
    f1 = 4.0 * drive["d1"] / pi
    if amplitude <= f1:
        return 0j, (0j if drive.carts == 2 else complex(np.nan))

    def force(v1: float) -> complex:
        """Return the command's phasor that moves cart 1 with the real phasor v1."""
        return complex(f1 + _reaction(drive, omega, v1)[0])

    high = 1.0
    while abs(force(high)) < amplitude:
        high *= 2.0
    v1 = float(brentq(lambda v: abs(force(v)) - amplitude, 0.0, high, xtol=1e-12 * high, rtol=1e-12))
    turn = force(v1).conjugate() / abs(force(v1))
    return v1 * turn, _reaction(drive, omega, v1)[1] * turn


def _reaction(drive: Drive, omega: float, v1: float) -> tuple[complex, complex]:
    """Return the force on cart 1 without its Coulomb friction [V], and V2 [mm/s], for the real phasor v1 [mm/s]."""
    inertia = 1j * omega * drive["m1"] + drive["b1"]
    if drive.carts == 1:
        return inertia * v1, complex(np.nan)
    coupling = drive["C"] + drive["k"] / (1j * omega)
    z2 = 1j * omega * drive["m2"] + drive["b2"] + coupling
    f2 = 4.0 * drive["d2"] / pi
    v2 = 0j
    if abs(coupling) * v1 > f2:
        # |z2·a + f2| = |coupling|·v1 for the amplitude a of cart 2
        square, half, rest = abs(z2) ** 2, z2.real * f2, f2**2 - (abs(coupling) * v1) ** 2
        a = (-half + np.sqrt(half**2 - square * rest)) / square
        v2 = coupling * v1 / (z2 + f2 / a)
    return (inertia + coupling) * v1 - coupling * v2, v2
