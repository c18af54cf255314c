"""An independent simulation of the rig: one run, from a command and surroundings to encoder counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from baselines.blind.kernel import FORCE_1, FORCE_2, LIMIT_V, STEPS, TRACK_POINTS, FloatArray, advance_run, vector


@dataclass(frozen=True, eq=False)
class Motion:
    """What one run did, sampled at 1 kHz.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Command [V].
    counts : ndarray, shape (2, n)
        Encoder counts.
    states : ndarray, shape (4, n)
        True x1 [mm], v1 [mm/s], x2, v2, before any encoder.
    shown : ndarray, shape (2, n)
        What the encoders' discs show before counting [mm].
    """

    u: FloatArray
    counts: FloatArray
    states: FloatArray
    shown: FloatArray


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Everything about a run that is not the drive: where and how it starts, and the tables.

    Attributes
    ----------
    over_time : ndarray, shape (7, n + 1)
        Factors of d1, d2, b1, b2; forces on cart 1 and 2 [V]; gain.
    track : ndarray, shape (4, TRACK_POINTS)
        Friction of cart 1, 2 relative to the level; force on cart 1, 2 [V]; from -1000 mm to 1000 mm.
    place
        Start of cart 1 on the track [mm].
    deflection
        Spring at the start, δ [mm].
    phases
        Of the encoders within a count, 0…1.
    """

    over_time: FloatArray
    track: FloatArray
    place: float = 0.0
    deflection: float = 0.0
    phases: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Law:
    r"""A controller in discrete time at 1 kHz, as plain arrays.

    With the readings :math:`y = (x_r, x_1, x_2)` [mm], encoders as counted, and the state :math:`z`,

    .. math::
       u &= C_0 z + D_0 y + F\,\mathrm{sat}((C_1 z + D_1 y)/v_0), \qquad \bar u = \mathrm{sat}(u, u_\mathrm{max}), \\
       z^+ &= A z + B y + L (\bar u - u).

    Attributes
    ----------
    A, B, C, D, L : ndarray, shapes (n, n), (n, 3), (2, n), (2, 3), (n,)
        Rows of C and D: command [V], velocity for the friction compensation [mm/s].
    limit
        Largest command of the controller [V]; the rig's own 8 V hold in any case.
    friction, threshold
        Level F of compensated dry friction [V] and the velocity v0 of full compensation [mm/s].
    shaper
        Pairs (delay in samples, weight) applied to the reference.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    L: FloatArray
    limit: float = LIMIT_V
    friction: float = 0.0
    threshold: float = 1.0
    shaper: tuple[tuple[int, float], ...] = ((0, 1.0),)

    def flat(self) -> FloatArray:
        """Return head and the rows (A B L), (C D 0) one after the other, ndarray, shape (LAW_HEAD + (n + 2)·(n + 4),)."""
        n = len(self.A)
        rows = np.zeros((n + 2, n + 4))
        rows[:n, :n], rows[:n, n : n + 3], rows[:n, n + 3] = self.A, self.B, self.L
        rows[n:, :n], rows[n:, n : n + 3] = self.C, self.D
        head = [self.limit, self.friction, self.threshold]
        return np.concatenate([head, rows.ravel()])

    def shaped(self, xr: FloatArray) -> FloatArray:
        """Return the reference after the shaper [mm]; before the run it stood where it begins."""
        at = np.arange(len(xr))
        return np.asarray(sum(weight * xr[np.maximum(at - delay, 0)] for delay, weight in self.shaper))


def p_law(gain: float, feedback: int = 2) -> Law:
    """Return u = gain·(xr - x) from encoder 1 or 2."""
    D = np.zeros((2, 3))
    D[0, 0], D[0, feedback] = gain, -gain
    return Law(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((2, 0)), D, np.zeros(0))


def quiet(n: int) -> Surroundings:
    """Return surroundings without any nuisance, for n samples."""
    table = np.ones((7, n + 1))
    table[[FORCE_1, FORCE_2]] = 0.0
    return Surroundings(table, np.zeros((4, TRACK_POINTS)))


def run(
    values: Mapping[str, float],
    surroundings: Surroundings,
    command: FloatArray,
    *,
    gain: float = 0.0,
    feedback: int = 2,
    law: Law | None = None,
    factor: float = 1.0,
    ahead: FloatArray | None = None,
    steps: int = STEPS,
) -> Motion:
    """Run the rig.

    Parameters
    ----------
    values
        Numbers named in :mod:`baselines.blind.kernel`; m1, m2, b1, b2, k, d1, d2 at least.
    surroundings
        Start and tables.
    command : ndarray, shape (n,)
        u [V], or the reference xr [mm] if ``gain`` is positive or a law is given.
    gain
        Kp [V/mm] of P-control; 0 is open loop.
    feedback
        The encoder it reads, 1 or 2.
    law
        A controller; it takes the place of P-control.
    factor
        On the controller's command, for trials of its gain margin.
    ahead : ndarray, shape (n,), optional
        Command known ahead, added to the controller's [V]; ``factor`` leaves it alone.
    steps
        Fine steps per sample.
    """
    n = len(command)
    u, counts, states, shown = np.zeros(n), np.zeros((2, n)), np.zeros((4, n)), np.zeros((2, n))
    s = surroundings
    start = np.array([s.place, s.place - s.deflection, s.phases[0], s.phases[1]])
    if law is None and gain > 0.0:
        law = p_law(gain, feedback)
    given = np.asarray(command, dtype=np.float64)
    asked = np.ascontiguousarray(given if law is None else law.shaped(given))
    flat, order = (np.zeros(0), -1) if law is None else (law.flat(), len(law.A))
    known = np.zeros(n) if ahead is None else np.ascontiguousarray(ahead, dtype=np.float64)
    advance_run(
        vector(values), s.over_time, s.track, start, asked, flat, order, factor, known, steps, u, counts, states, shown
    )  # fmt: skip
    return Motion(u, counts, states, shown)
