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
forces act on it. That holds where cart and simulation both rest. Where only the cart does, its deviation moves; and its rest is
an outcome of the forces, so that a filter that believes every rest and excuses every motion finds too much friction.
Velocities are summed to positions first: their error is a difference of roundings, and the sum of it white. What was lost is an
unknown offset o of the reading afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined, kernel
from flexdrive_gym.recording import BoolArray, FloatArray
from identification.mismatch.fitting.bench import Rows
from identification.mismatch.fitting.experiments import IntArray

STATES = 8
# time in which a deviation of a cart at rest ends [s]
_STOPS_S = 0.005
# share of its fastest time constant over which a drive's series is summed, and its terms
_SHORT, _TERMS = 0.5, 18
# relative change of a variance per block below which a filter repeats itself
_SETTLED = 1e-7
# columns that are whitened together
_TOGETHER = 256
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
    b1, b2, k = (values.get(name, 0.0) for name in ("b1", "b2", "k"))
    m1, m2 = values["m1"], values.get("m2", values["m1"])
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
    return _over(F, L, h)


def _over(F: FloatArray, L: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
    """Return the transition exp(F h), and the integral of exp(F s) L exp(Fᵀ s) over a step.

    By their series over so short a part of the step that it converges at once, and then doubled: of positive terms a sum stays
    positive, however stiff the drive is. (By one exponential of both, C. F. Van Loan 1978, growing and decaying parts cancel.)
    """
    fastest = float(np.abs(np.linalg.eigvals(F)).max()) * h
    doublings = max(0, int(np.ceil(np.log2(max(fastest, 1e-12) / _SHORT))))
    part = h / 2**doublings
    power, term = np.eye(STATES), L * part
    A, Q = power.copy(), term.copy()
    for n in range(1, _TERMS):
        power = F @ power * (part / n)
        half = F @ term
        term = (half + half.T) * (part / (n + 1))
        A += power
        Q += term
    for _ in range(doublings):
        Q = Q + A @ Q @ A.T
        A = A @ A
    return A, 0.5 * (Q + Q.T)


@inlined
def _carried(A: Any, x: Any, out: Any, width: int) -> None:
    """Write A x, shape (8, columns), for the first columns."""
    for i in range(STATES):
        for j in range(width):
            out[i, j] = 0.0
        for k in range(STATES):
            a = A[i, k]
            # half of a transition is zero, and columns lie side by side
            if a != 0.0:
                for j in range(width):
                    out[i, j] += a * x[k, j]


@kernel
def _riccati(As: Any, Qs: Any, mode: Any, P: Any, rounding: Any, valid: Any, gain: Any, variance: Any) -> None:
    """Write the filter's gains, shape (blocks, carts, 8), and the innovations' variances, shape (carts, blocks).

    ``P``, the covariance at the start, is used up.
    """
    carts, blocks = valid.shape
    room, turned = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    shown, before = np.zeros(STATES), np.zeros(STATES)
    settled = False
    for b in range(blocks):
        same = b > 0 and mode[b] == mode[b - 1]
        for c in range(carts):
            same = same and valid[c, b] == valid[c, b - 1]
            if b > 0 and valid[c, b] and not valid[c, b - 1]:
                P[6 + c, 6 + c] += _UNKNOWN * rounding[c]
        if settled and same:
            gain[b], variance[:, b] = gain[b - 1], variance[:, b - 1]
            continue
        settled = False
        A, Q = As[mode[b]], Qs[mode[b]]
        # A P Aᵀ = A (A P)ᵀ, for P is symmetric
        _carried(A, P, room, STATES)
        for i in range(STATES):
            for k in range(STATES):
                turned[i, k] = room[k, i]
        _carried(A, turned, P, STATES)
        P += Q
        for c in range(carts):
            if not valid[c, b]:
                continue
            row = 2 * c
            for i in range(STATES):
                shown[i] = P[row, i] + P[6 + c, i]
            variance[c, b] = shown[row] + shown[6 + c] + rounding[c]
            for i in range(STATES):
                gain[b, c, i] = shown[i] / variance[c, b]
                for k in range(STATES):
                    P[i, k] -= gain[b, c, i] * shown[k]
            # Joseph's form stays positive where forces are large and a reading has hardly any error
            for i in range(STATES):
                shown[i] = P[i, row] + P[i, 6 + c]
            for i in range(STATES):
                for k in range(STATES):
                    P[i, k] += (rounding[c] * gain[b, c, i] - shown[i]) * gain[b, c, k]
        # at rest the gain stays while unknown forces grow: only a covariance that a moving drive repeats has settled
        if same and mode[b] == 0:
            settled = True
            for i in range(STATES):
                settled = settled and abs(P[i, i] - before[i]) <= _SETTLED * P[i, i]
        for i in range(STATES):
            before[i] = P[i, i]


@kernel
def _innovations(As: Any, mode: Any, gain: Any, scale: Any, x: Any, valid: Any, step: float, out: Any) -> None:
    """Write whitened rows, shape (carts, blocks, columns); ``step`` sums rows to positions first, 0 where they are positions.

    All but the sums are in the precision of ``x``. So many columns go together that their states stay in the fastest cache.
    """
    carts, blocks, columns = x.shape
    z, moved = np.empty((STATES, _TOGETHER), x.dtype), np.empty((STATES, _TOGETHER), x.dtype)
    summed, error = np.empty((carts, _TOGETHER)), np.empty(_TOGETHER, x.dtype)
    for first in range(0, columns, _TOGETHER):
        width = min(_TOGETHER, columns - first)
        z[:] = 0.0
        summed[:] = 0.0
        for b in range(blocks):
            _carried(As[mode[b]], z, moved, width)
            for c in range(carts):
                if not valid[c, b]:
                    for j in range(width):
                        out[c, b, first + j] = 0.0
                    continue
                if step > 0.0:
                    for j in range(width):
                        summed[c, j] += step * x[c, b, first + j]
                else:
                    for j in range(width):
                        summed[c, j] = x[c, b, first + j]
                for j in range(width):
                    error[j] = summed[c, j] - moved[2 * c, j] - moved[6 + c, j]
                for j in range(width):
                    out[c, b, first + j] = error[j] * scale[c, b]
                for i in range(STATES):
                    own = gain[b, c, i]
                    if own != 0.0:
                        for j in range(width):
                            moved[i, j] += own * error[j]
            z, moved = moved, z


@kernel
def _innovations_of_one(As: Any, mode: Any, gain: Any, scale: Any, x: Any, valid: Any, step: float, out: Any) -> None:
    """Do what :func:`_innovations` does for a single column, shape (carts, blocks): side by side lie the states.

    ``As`` are transposed.
    """
    carts, blocks = x.shape
    z, moved, summed = np.zeros(STATES), np.zeros(STATES), np.zeros(carts)
    for b in range(blocks):
        A = As[mode[b]]
        for i in range(STATES):
            moved[i] = 0.0
        for k in range(STATES):
            for i in range(STATES):
                moved[i] += A[k, i] * z[k]
        for c in range(carts):
            if not valid[c, b]:
                out[c, b] = 0.0
                continue
            summed[c] = summed[c] + step * x[c, b] if step > 0.0 else x[c, b]
            error = summed[c] - moved[2 * c] - moved[6 + c]
            out[c, b] = error * scale[c, b]
            for i in range(STATES):
                moved[i] += gain[b, c, i] * error
        z, moved = moved, z


@dataclass(frozen=True, eq=False)
class Filter:
    """Kalman filter of one recording, whose gains do not depend on what it filters.

    Attributes
    ----------
    A : ndarray, shape (4, 8, 8)
        Transition in every mode.
    mode : ndarray of int, shape (blocks,)
        Which carts rest.
    gain : ndarray, shape (blocks, carts, 8)
    variance : ndarray, shape (carts, blocks)
        Of the innovations; 1 where there is no reading.
    valid : ndarray of bool, shape (carts, blocks)
    step
        Time between velocities, which are summed to positions first [s]; 0 for positions.
    """

    A: FloatArray
    mode: IntArray
    gain: FloatArray
    variance: FloatArray
    valid: BoolArray
    step: float

    @classmethod
    def of(
        cls,
        A: FloatArray,
        Q: FloatArray,
        mode: IntArray,
        start: FloatArray,
        rounding: FloatArray,
        valid: BoolArray,
        step: float = 0.0,
    ) -> Filter:
        """Return the filter of a recording.

        Parameters
        ----------
        A, Q : ndarray, shape (4, 8, 8)
            Of every mode.
        start : ndarray, shape (8,)
            Variances of the state at the start.
        rounding : ndarray, shape (carts,)
            Variance of a position reading [mm²].
        """
        carts, blocks = valid.shape
        gain, variance = np.zeros((blocks, carts, STATES)), np.ones((carts, blocks))
        _riccati(A, Q, mode, np.diag(start), rounding, valid, gain, variance)
        return cls(A, mode, gain, variance, valid, step)

    def white(self, rows: Rows) -> Rows:
        """Return whitened rows, shape (carts, blocks, columns), in the precision of the rows."""
        out, scale = np.empty(rows.shape, rows.dtype), 1.0 / np.sqrt(self.variance)
        if rows.shape[2] == 1:
            turned = np.ascontiguousarray(self.A.transpose(0, 2, 1))
            one, made = np.asarray(rows[..., 0], dtype=np.float64, order="C"), np.empty(rows.shape[:2])
            _innovations_of_one(turned, self.mode, self.gain, scale, one, self.valid, self.step, made)
            out[..., 0] = made
        else:
            A, gain, own = (np.asarray(x, dtype=rows.dtype) for x in (self.A, self.gain, scale))
            _innovations(A, self.mode, gain, own, np.ascontiguousarray(rows), self.valid, self.step, out)
        return out
