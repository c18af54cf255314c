"""An independent simulation of the rig: one run, from a command and disturbances to encoder counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from baselines.rig_simulator.kernel import (
    COUNT_MM,
    FORCE_1,
    FORCE_2,
    INDEX,
    LIMIT_V,
    NULLS,
    REMEMBERED,
    RING,
    SAMPLE_S,
    SLIDERS,
    STEPS,
    TRACK_POINTS,
    FloatArray,
    advance_run,
)

Sampled = Callable[[float, float, float, float], float]


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
class Disturbances:
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


def quiet(n: int) -> Disturbances:
    """Return disturbances without any nuisance, for n samples."""
    table = np.ones((7, n + 1))
    table[[FORCE_1, FORCE_2]] = 0.0
    return Disturbances(table, np.zeros((4, TRACK_POINTS)))


def run(
    values: Mapping[str, float],
    disturbances: Disturbances,
    command: FloatArray,
    *,
    controller: Law | Sampled | None = None,
    factor: float = 1.0,
    feedforward: FloatArray | None = None,
    steps: int = STEPS,
) -> Motion:
    """Run the rig.

    Parameters
    ----------
    values
        Numbers named in :mod:`baselines.rig_simulator.kernel`; m1, m2, b1, b2, k, d1, d2 at least.
    disturbances
        Start and tables.
    command : ndarray, shape (n,)
        u [V], or with a controller the reference xr [mm].
    controller
        A law, or a black box that is asked at every sample for its command [V], from the time [s], the reference and the two
        encoders [mm]; ``None`` is open loop.
    factor
        On the controller's command, for trials of its gain margin.
    feedforward : ndarray, shape (n,), optional
        Command known beforehand, added to the controller's [V]; ``factor`` leaves it alone.
    steps
        Fine steps per sample.
    """
    n = len(command)
    u, counts, states, shown = np.zeros(n), np.zeros((2, n)), np.zeros((4, n)), np.zeros((2, n))
    s = disturbances
    start = np.array([s.place, s.place - s.deflection, s.phases[0], s.phases[1]])
    law, asked = (controller, None) if controller is None or isinstance(controller, Law) else (None, controller)
    given = np.ascontiguousarray(command, dtype=np.float64)
    if law is not None:
        given = np.ascontiguousarray(law.shaped(given))
    flat, order = (np.zeros(0), -1) if law is None else (law.flat(), len(law.A))
    known = np.zeros(n) if feedforward is None else np.ascontiguousarray(feedforward, dtype=np.float64)
    keep, p = memory_of(order), vector(values)
    if asked is None:
        advance_run(
            p, s.over_time, s.track, start, given, flat, order, factor, known, steps, 0, n, keep, u, counts, states, shown
        )  # fmt: skip
        return Motion(u, counts, states, shown)
    commands = np.zeros(n)
    for i in range(n):
        wish = float(asked(i * SAMPLE_S, float(given[i]), COUNT_MM * counts[0, i], COUNT_MM * counts[1, i]))
        commands[i] = min(max(factor * wish + known[i], -LIMIT_V), LIMIT_V)
        advance_run(
            p, s.over_time, s.track, start, commands, flat, -1, factor, known, steps, i, i + 1, keep, u, counts, states, shown
        )  # fmt: skip
    return Motion(u, counts, states, shown)


def vector(values: Mapping[str, float]) -> FloatArray:
    """Return the kernel's vector.

    Raises
    ------
    KeyError
        For a name the rig does not know.
    """
    p = np.array(list(NULLS.values()))
    for name, value in values.items():
        if name not in INDEX:
            raise KeyError(f"values: the blind rig has no number called {name!r}; it knows {', '.join(NULLS)}.")
        p[INDEX[name]] = value
    return p


def memory_of(order: int) -> FloatArray:
    """Return room for what a run remembers between calls of :func:`advance_run`, with ``order`` states of a controller."""
    return np.zeros(REMEMBERED + 6 + SLIDERS + 2 * RING + max(order, 0))
