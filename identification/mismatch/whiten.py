r"""Innovations of a drive that unknown forces disturb: residuals of a free simulation, whitened.

Around the simulation the carts' deviations obey the linear drive, driven by forces that nobody knows: white ones of intensity
:math:`q_c` and slow ones, :math:`\tau \dot f_c = -f_c + \sqrt{2\tau}\, s_c w_c`. With the state
:math:`z = (x_1, v_1, x_2, v_2, f_1, f_2, o_1, o_2)` and an encoder that errs by its rounding,

.. math:: z_{b+1} = A z_b + w_b, \qquad y_{cb} = x_c + o_c + n_{cb}, \qquad \operatorname{cov} w_b = Q, \quad
\operatorname{var} n = \rho,

the innovations of the Kalman filter over their standard deviations are white with variance one, and their squares with the
logarithms of those variances are the likelihood (R. K. Mehra 1970; L. Ljung, System Identification, 1999, ch. 7). Where forces
are large against the rounding this is the equation error, where they are small the output error. The filter is linear,
so the same filter turns sensitivities into regressors.

A cart at rest is held by friction, whatever pulls: its velocity then ends within milliseconds, and neither spring nor
forces act on it.
Velocities are summed to positions first: their error is a difference of roundings, and the sum of it white. What was lost is an
unknown offset o of the reading afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.linalg import expm

from flexdrive_gym.drive.compilation import kernel
from flexdrive_gym.recording import BoolArray, FloatArray
from identification.mismatch.experiments import IntArray

STATES = 8
# time in which a deviation of a cart at rest ends [s]
_STOPS_S = 0.005
# of a gain, under which the filter counts as settled
_SETTLED = 1e-7
# variance of a position that nothing is known of, in variances of its rounding
_UNKNOWN = 1e8


def transitions(
    values: Mapping[str, float], h: float, q: FloatArray, s: FloatArray, tau: float
) -> tuple[FloatArray, FloatArray]:
    """Return A and Q over a step for every mode: both carts moving, cart 1 at rest, cart 2 at rest, both, shape (4, 8, 8).

    Parameters
    ----------
    values
        Masses, dampers and spring; one cart where there is no ``m2``.
    h
        Step [s].
    q, s : ndarray, shape (2,)
        Intensity of white forces [V √s], and standard deviation of slow ones [V].
    tau
        Their correlation time [s].
    """
    found = [_transition(values, h, q, s, tau, (bool(mode & 1), bool(mode & 2))) for mode in range(4)]
    return np.array([A for A, _ in found]), np.array([Q for _, Q in found])


def _transition(
    values: Mapping[str, float], h: float, q: FloatArray, s: FloatArray, tau: float, rests: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray]:
    m1, b1 = values["m1"], values.get("b1", 0.0)
    m2, b2, k = values.get("m2", m1), values.get("b2", 0.0), values.get("k", 0.0)
    F, L = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    F[0, 1] = F[2, 3] = 1.0
    F[1, :6] = [-k / m1, -b1 / m1, k / m1, 0.0, 1.0 / m1, 0.0]
    F[3, :6] = [k / m2, 0.0, -k / m2, -b2 / m2, 0.0, 1.0 / m2]
    L[1, 1], L[3, 3] = (q[0] / m1) ** 2, (q[1] / m2) ** 2
    L[4, 4], L[5, 5] = 2.0 * s**2 / tau
    for c in range(2):
        if rests[c]:
            # friction holds it, whatever pulls
            F[1 + 2 * c] = 0.0
            F[1 + 2 * c, 1 + 2 * c] = -1.0 / _STOPS_S
    F[4, 4] = F[5, 5] = -1.0 / tau
    # C. F. Van Loan, Computing integrals involving the matrix exponential, 1978
    both = np.block([[-F, L], [np.zeros_like(F), F.T]])
    E = expm(both * h)
    A = E[STATES:, STATES:].T
    Q = A @ E[:STATES, STATES:]
    return A, 0.5 * (Q + Q.T)


@kernel
def innovations(
    As: Any, Qs: Any, mode: Any, P: Any, rounding: Any, y: Any, valid: Any, gain: Any, z: Any, out: Any
) -> float:
    """Write whitened rows, shape (carts, blocks, columns).

    Returns the sum of the logarithms of the innovations' variances of moving carts.
    ``P``, the covariance at the start, is used up; ``gain`` (carts, 8), ``z`` (8, columns) are room to work in.
    """
    carts, blocks, columns = y.shape
    n = As.shape[1]
    total, settled = 0.0, False
    variance = np.zeros(carts)
    before = np.zeros((carts, n))
    step, moved, shown, error = np.zeros((n, n)), np.zeros((n, columns)), np.zeros(n), np.zeros(columns)
    for b in range(blocks):
        A, Q = As[mode[b]], Qs[mode[b]]
        if b > 0 and mode[b] != mode[b - 1]:
            settled = False
        for i in range(n):
            for j in range(columns):
                moved[i, j] = 0.0
            for k in range(n):
                a = A[i, k]
                # half of a transition is zero, and columns lie side by side
                if a != 0.0:
                    for j in range(columns):
                        moved[i, j] += a * z[k, j]
        for i in range(n):
            for j in range(columns):
                z[i, j] = moved[i, j]
        if b > 0:
            for c in range(carts):
                if valid[c, b] != valid[c, b - 1]:
                    settled = False
                    if valid[c, b]:
                        P[6 + c, 6 + c] += _UNKNOWN * rounding[c]
        if not settled:
            for i in range(n):
                for k in range(n):
                    step[i, k] = 0.0
                for m in range(n):
                    a = A[i, m]
                    if a != 0.0:
                        for k in range(n):
                            step[i, k] += a * P[m, k]
            for i in range(n):
                for k in range(n):
                    P[i, k] = Q[i, k]
            for k in range(n):
                for m in range(n):
                    a = A[k, m]
                    if a != 0.0:
                        for i in range(n):
                            P[i, k] += step[i, m] * a
        change = 0.0
        for c in range(carts):
            if not valid[c, b]:
                for j in range(columns):
                    out[c, b, j] = 0.0
                continue
            row = 2 * c
            if not settled:
                for i in range(n):
                    shown[i] = P[i, row] + P[i, 6 + c]
                variance[c] = shown[row] + shown[6 + c] + rounding[c]
                for i in range(n):
                    before[c, i] = gain[c, i]
                    gain[c, i] = shown[i] / variance[c]
                    change = max(change, abs(gain[c, i] - before[c, i]) / (abs(gain[c, i]) + 1e-12))
                for i in range(n):
                    for k in range(n):
                        P[i, k] -= gain[c, i] * shown[k]
            scale = 1.0 / np.sqrt(variance[c])
            for j in range(columns):
                error[j] = y[c, b, j] - z[row, j] - z[6 + c, j]
                out[c, b, j] = error[j] * scale
            for i in range(n):
                own = gain[c, i]
                for j in range(columns):
                    z[i, j] += own * error[j]
            if not (mode[b] >> c) & 1:
                total += np.log(variance[c])
        if change < _SETTLED and b > 0:
            settled = True
    return total


def whitened(
    A: FloatArray,
    Q: FloatArray,
    mode: IntArray,
    start: FloatArray,
    rounding: FloatArray,
    rows: FloatArray,
    valid: BoolArray,
) -> tuple[FloatArray, float]:
    """Return whitened rows, shape (carts, blocks, columns), and the sum of the logarithms of the innovations' variances.

    Parameters
    ----------
    A, Q : ndarray, shape (4, 8, 8)
        Of every mode.
    mode : ndarray of int, shape (blocks,)
        Which carts rest.
    start : ndarray, shape (8,)
        Variances of the state at the start.
    rounding : ndarray, shape (carts,)
        Variance of a position reading [mm²].
    rows : ndarray, shape (carts, blocks, columns)
        Positions.
    valid : ndarray of bool, shape (carts, blocks)
    """
    carts, _, columns = rows.shape
    out = np.empty_like(rows)
    room = np.zeros((carts, STATES)), np.zeros((STATES, columns))
    total = innovations(A, Q, mode, np.diag(start), rounding, np.ascontiguousarray(rows), valid, *room, out)
    return out, float(total)
