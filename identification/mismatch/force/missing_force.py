r"""The missing force on each cart: what would have to be added to the drive's equations to explain a recording.

The linear drive between two friction directions is :math:`M\ddot q + B\dot q + Kq = E(u, 0)^T - D\,s + g`, with the
directions :math:`s_i` read off the measured velocities. The missing forces :math:`g_1, g_2` [V] are states that wander
slowly, :math:`\tau \dot g = -g + w`; a Kalman filter and the Rauch-Tung-Striebel smoother estimate them with their band from
the encoder counts (T. J. Rogers, T. Friis, A latent restoring force approach to nonlinear system identification, MSSP 180,
2022; H. E. Rauch, F. Tung, C. T. Striebel, AIAA J. 3, 1965). After a stretch of faulty counts an encoder may be off by what
it lost, so its offset is a state too, free to jump there.

While a cart rests, friction takes whatever is missing; such samples say nothing and are marked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.ndimage import binary_dilation, gaussian_filter1d

from flexdrive_gym.drive.compilation import kernel
from flexdrive_gym.drive.linear import LinearDrive
from flexdrive_gym.recording import BoolArray, FloatArray, Recording
from flexdrive_gym.units import Units
from identification.signals import motions

# the missing force wanders with this standard deviation [V] and forgets in this time [s]: reversals are followed, encoder
# counts are not, and counts that an encoder lost are not taken for a constant force
SIZE, MEMORY_S = 0.5, 0.1
STEP_S = 0.004
_SMOOTH_S = 0.004
_RESTING = 6.0
_SETTLE_S = 0.03


@dataclass(frozen=True, eq=False)
class MissingForce:
    """Smoothed motion and missing force of one recording.

    Attributes
    ----------
    recording
        Its name.
    t, u : ndarray, shape (n,)
        Time [s] and command [V], every few milliseconds.
    x, v : ndarray, shape (carts, n)
        Smoothed positions [mm] and velocities [mm/s].
    g, band : ndarray, shape (carts, n)
        Missing force and its standard deviation [V].
    usable : ndarray of bool, shape (carts, n)
        Where the cart moves and no fault is near.
    """

    recording: str
    t: FloatArray
    u: FloatArray
    x: FloatArray
    v: FloatArray
    g: FloatArray
    band: FloatArray
    usable: BoolArray

    def of_rig(self, units: Units) -> MissingForce:
        """Return the numbers that the rig's owner reads."""
        time, length, speed, force = (units.one(u) for u in ("s", "mm", "mm/s", "V"))
        return replace(
            self,
            t=self.t / time,
            u=self.u / force,
            x=self.x / length,
            v=self.v / speed,
            g=self.g / force,
            band=self.band / force,
        )

    @property
    def delta(self) -> FloatArray:
        """Deflection of the spring x1 - x2 [mm]; zero for one cart."""
        return np.asarray(self.x[0] - self.x[1]) if len(self.x) == 2 else np.zeros_like(self.t)


@kernel
def _smooth(
    A: Any,
    B: Any,
    U: Any,
    Y: Any,
    seen: Any,
    jump: Any,
    Q: Any,
    loose: Any,
    R: float,
    x0: Any,
    P0: Any,
    mean: Any,
    var: Any,
) -> None:
    """Kalman filter forward, Rauch-Tung-Striebel backward; position i is measured with offset state n - carts + i."""
    steps, carts = Y.shape
    n = len(x0)
    filtered, predicted = np.zeros((steps, n)), np.zeros((steps, n))
    Pf, Pp = np.zeros((steps, n, n)), np.zeros((steps, n, n))
    x, P = x0.copy(), P0.copy()
    for i in range(steps):
        if i > 0:
            x = A @ x + B @ U[i - 1]
            P = A @ P @ A.T + Q
            for c in range(carts):
                if jump[i, c]:
                    P[n - carts + c, n - carts + c] += loose[c]
        predicted[i], Pp[i] = x, P
        for c in range(carts):
            if seen[i, c]:
                o = n - carts + c
                column = P[:, c] + P[:, o]
                gain = column / (column[c] + column[o] + R)
                x = x + gain * (Y[i, c] - x[c] - x[o])
                P = P - np.outer(gain, column)
        filtered[i], Pf[i] = x, P
    mean[steps - 1] = filtered[steps - 1]
    S = Pf[steps - 1].copy()
    var[steps - 1] = np.diag(S)
    for i in range(steps - 2, -1, -1):
        G = np.linalg.solve(Pp[i + 1], A @ Pf[i]).T
        mean[i] = filtered[i] + G @ (mean[i + 1] - predicted[i + 1])
        S = Pf[i] + np.ascontiguousarray(G @ (S - Pp[i + 1])) @ G.T
        var[i] = np.diag(S)


def positions(recording: Recording) -> FloatArray:
    """Return measured positions [mm], shape (carts, n): as recorded, else the sum of the recorded velocities."""
    rows = []
    for x, v in ((recording.x1, recording.v1), (recording.x2, recording.v2)):
        if x is not None:
            rows.append(x)
        elif v is not None:
            rows.append(np.cumsum(v) * recording.sample_time)
        elif not rows:
            rows.append(np.zeros(recording.n))
    return np.array(rows)


def missing_force(values: Mapping[str, float], recording: Recording) -> MissingForce:
    """Estimate the missing forces of one recording.

    Parameters
    ----------
    values
        Parameters of the drive; those of the linear drive and Coulomb friction are used.
    recording
        Any run of the drive, open or closed loop.
    """
    # every few samples: a slowly varying force needs no more, and the smoother's cost is its number of steps
    every = max(1, round(STEP_S / recording.sample_time))
    h, Y = recording.sample_time * every, positions(recording)[:, ::every]
    carts = len(Y)
    speeds, valid = motions(recording)
    fine = np.array([gaussian_filter1d(v, _SMOOTH_S / recording.sample_time) for v in speeds])
    seen = np.column_stack([keep[::every] for keep in valid])
    jump = np.zeros_like(seen)
    jump[1:] = seen[1:] & ~seen[:-1]
    drive = _linear(values, carts)
    A, B = _discrete(drive, carts, h, values.get("k", 0.0))
    x0, P0 = _start(Y[:, 0], fine[:, 0])
    quantum = np.array([max(q, 1e-4) for q in recording.quantum[:carts]])
    mean, var = np.zeros((len(seen), 4 * carts)), np.zeros((len(seen), 4 * carts))
    _smooth(
        A,
        B,
        np.ascontiguousarray(_known_force(values, recording, fine, every).T),
        np.ascontiguousarray(Y.T),
        seen,
        jump,
        _wandering(drive.matrices[0], carts, h),
        np.full(carts, 1e4),
        float(np.mean(quantum) ** 2 / 6.0),
        x0,
        P0,
        mean,
        var,
    )
    x, v, g, _ = np.split(mean.T, 4)
    return MissingForce(
        recording.name,
        recording.t[::every],
        recording.u[::every],
        np.ascontiguousarray(x),
        np.ascontiguousarray(v),
        np.ascontiguousarray(g),
        np.sqrt(np.maximum(var[:, 2 * carts : 3 * carts].T, 0.0)),
        _usable(seen, v, h),
    )


def _linear(values: Mapping[str, float], carts: int) -> LinearDrive:
    return LinearDrive(
        values["m1"],
        values["m2"] if carts == 2 else np.inf,
        values.get("b1", 0.0),
        values.get("b2", 0.0),
        values.get("k", 0.0),
        values.get("C", 0.0),
    )


def _known_force(values: Mapping[str, float], recording: Recording, speeds: FloatArray, every: int) -> FloatArray:
    """Return the command and dry friction on each cart, means over steps, shape (carts, steps) [V]."""
    level = np.array([values.get("d1", 0.0), values.get("d2", 0.0)])[: len(speeds)]
    force = -level[:, None] * _means(np.clip(speeds / _RESTING, -1.0, 1.0), every)
    force[0] += _means(recording.u[None, :], every)[0]
    return np.asarray(force)


def _wandering(M: FloatArray, carts: int, h: float) -> FloatArray:
    """Return the covariance of what a step adds to positions, velocities, missing forces and encoder offsets."""
    wander = SIZE * np.sqrt(2.0 / MEMORY_S)
    Q = np.zeros((4 * carts, 4 * carts))
    for c in range(carts):
        Q[2 * carts + c, 2 * carts + c] = wander**2 * h
        # the discrete model holds g over a sample: let the velocity take up the rest
        Q[carts + c, carts + c] = (wander * h / M[c, c]) ** 2 * h / 3.0
        # an offset is never exactly known, or the smoother's inverse does not exist
        Q[3 * carts + c, 3 * carts + c] = 1e-12
    return Q


def _start(positions: FloatArray, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of the state at the first sample."""
    carts = len(positions)
    x0 = np.concatenate([positions, speeds, np.zeros(2 * carts)])
    variance = np.repeat([25.0, 25.0, 1.0, 1e-9], carts)
    variance[0] = 1e-6
    P0 = np.diag(variance)
    if carts == 2:
        # at rest the spring may be deflected within the friction of cart 2; encoders start at zero all the same
        P0[-1, -1] = 25.0
    return x0, P0


def _usable(seen: BoolArray, v: FloatArray, h: float) -> BoolArray:
    """Return where each cart moves and no fault of any encoder is near, shape (carts, steps)."""
    settle = max(1, round(_SETTLE_S / h))
    near: BoolArray = np.asarray(binary_dilation(~seen, np.ones((2 * settle + 1, 1), dtype=bool)))
    around = np.ones(2 * max(1, round(_SMOOTH_S / h)) + 1, dtype=bool)
    rest = np.array([binary_dilation(np.abs(row) < _RESTING, around) for row in v])
    usable = ~np.any(near, axis=1, keepdims=True).T & ~rest
    usable[:, :settle] = False
    usable[:, -settle:] = False
    return np.asarray(usable)


def _means(rows: FloatArray, every: int) -> FloatArray:
    """Return means over the samples until the next step, shape (rows, steps)."""
    edges = np.arange(0, rows.shape[1], every)
    return np.asarray(np.add.reduceat(rows, edges, axis=1) / np.diff(np.append(edges, rows.shape[1])))


def _discrete(drive: LinearDrive, carts: int, h: float, to_ground: float) -> tuple[FloatArray, FloatArray]:
    """Return the discrete model of positions, velocities, missing forces and encoder offsets."""
    M, D, K = drive.matrices
    if carts == 1:
        # what the spring of a single seen cart leads to rests
        K = np.array([[to_ground]])
    inverse = np.linalg.inv(M)
    n = 4 * carts
    F, G = np.zeros((n, n)), np.zeros((n, carts))
    F[:carts, carts : 2 * carts] = np.eye(carts)
    F[carts : 2 * carts, :carts] = -inverse @ K
    F[carts : 2 * carts, carts : 2 * carts] = -inverse @ D
    F[carts : 2 * carts, 2 * carts : 3 * carts] = inverse
    F[2 * carts : 3 * carts, 2 * carts : 3 * carts] = -np.eye(carts) / MEMORY_S
    G[carts : 2 * carts] = inverse
    E = expm(np.block([[F, G], [np.zeros((carts, n + carts))]]) * h)
    return np.ascontiguousarray(E[:n, :n]), np.ascontiguousarray(E[:n, n:])
