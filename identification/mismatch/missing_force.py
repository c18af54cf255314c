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
    two = carts == 2
    drive = LinearDrive(
        values["m1"],
        values["m2"] if two else np.inf,
        values.get("b1", 0.0),
        values.get("b2", 0.0),
        values.get("k", 0.0),
        values.get("C", 0.0),
    )
    speeds, valid = motions(recording)
    fine = np.array([gaussian_filter1d(v, _SMOOTH_S / recording.sample_time) for v in speeds])
    speed = np.ascontiguousarray(fine[:, ::every])
    s = _means(np.clip(fine / _RESTING, -1.0, 1.0), every)
    level = np.array([values.get("d1", 0.0), values.get("d2", 0.0)])[:carts]
    force = -level[:, None] * s
    u = recording.u[::every]
    force[0] += _means(recording.u[None, :], every)[0]
    seen = np.column_stack([keep[::every] for keep in valid])
    jump = np.zeros_like(seen)
    jump[1:] = seen[1:] & ~seen[:-1]
    A, B = _discrete(drive, carts, h, values.get("k", 0.0))
    n = 4 * carts
    M, wander = drive.matrices[0], SIZE * np.sqrt(2.0 / MEMORY_S)
    Q = np.zeros((n, n))
    for c in range(carts):
        Q[2 * carts + c, 2 * carts + c] = wander**2 * h
        # the discrete model holds g over a sample: let the velocity take up the rest
        Q[carts + c, carts + c] = (wander * h / M[c, c]) ** 2 * h / 3.0
    # never exactly known, or the smoother's inverse does not exist
    Q += np.diag(np.concatenate([np.full(n - carts, 0.0), np.full(carts, 1e-12)]))
    quantum = np.array([max(q, 1e-4) for q in recording.quantum[:carts]])
    x0 = np.concatenate([Y[:, 0], speed[:, 0], np.zeros(2 * carts)])
    P0 = np.diag(
        np.concatenate(
            [[1e-6], np.full(carts - 1, 25.0), np.full(carts, 25.0), np.full(carts, 1.0), np.full(carts, 1e-9)]
        )
    )
    if two:
        # at rest the spring may be deflected within the friction of cart 2; encoders start at zero all the same
        P0[n - 1, n - 1] = 25.0
    mean, var = np.zeros((len(u), n)), np.zeros((len(u), n))
    _smooth(
        A,
        B,
        np.ascontiguousarray(force.T),
        np.ascontiguousarray(Y.T),
        seen,
        jump,
        Q,
        np.full(carts, 1e4),
        float(np.mean(quantum) ** 2 / 6.0),
        x0,
        P0,
        mean,
        var,
    )
    settle = max(1, round(_SETTLE_S / h))
    near: BoolArray = np.asarray(binary_dilation(~seen, np.ones((2 * settle + 1, 1), dtype=bool)))
    v = mean[:, carts : 2 * carts].T
    rest = np.array(
        [
            binary_dilation(np.abs(row) < _RESTING, np.ones(2 * max(1, round(_SMOOTH_S / h)) + 1, dtype=bool))
            for row in v
        ]
    )
    usable = ~np.any(near, axis=1, keepdims=True).T & ~rest
    usable[:, :settle] = False
    usable[:, -settle:] = False
    return MissingForce(
        recording.name,
        recording.t[::every],
        u,
        np.ascontiguousarray(mean[:, :carts].T),
        np.ascontiguousarray(v),
        np.ascontiguousarray(mean[:, 2 * carts : 3 * carts].T),
        np.sqrt(np.maximum(var[:, 2 * carts : 3 * carts].T, 0.0)),
        usable,
    )


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
