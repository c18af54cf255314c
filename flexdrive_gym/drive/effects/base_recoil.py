r"""A track that gives way: it is pushed back by what moves the carts, and both encoders read relative to it.

The track has mass M and stands on a stiffness :math:`k_b` with damping :math:`c_b`; :math:`x_b` is its position in the room
and :math:`a_b` its acceleration. Positions, velocities and directions of sliding of the carts are relative to the track, so

.. math::
   m_i(\dot v_i + a_b) = F_i, \qquad M a_b = -k_b x_b - c_b \dot x_b - \sum_i (F_i - F_{s,i}),

with all forces on cart i in :math:`F_i`, friction included, and the spring's :math:`F_{s,i}`, which the carts exert on each
other and which cancel in the sum. A cart that sticks moves with the track: its friction is what gives it :math:`a_b`, so its
mass counts to the track's, and it tears loose where :math:`m_i a_b` asks for more than friction can give.

The parameters are the compliance :math:`1/k_b`, to which the effect is proportional and which is 0 for a track that does not
move, its frequency :math:`\omega_b = \sqrt{k_b/M}` without the carts' masses and its damping ratio
:math:`\zeta = c_b/(2M\omega_b)`. Worked check: M = 2.3e-3 V s²/mm at 34 Hz stands on 105 V/mm, a compliance of 9.5e-3
mm/V. A command that reverses from 2 V to -2 V throws it back at :math:`\Delta u/(M\omega_b)` = 8 mm/s after a quarter of
its period, 7 ms; the encoder of cart 2, on which no force has changed yet, shows that as a jump of its own.

What hangs on a cart (an appendage, a motor behind its play) is pushed relative to the track, as a rotor is: its own mass
does not feel :math:`a_b`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexdrive_gym.drive.effects._effect import Effect, Parameter

# steps per radian of the track's own motion: a fourth-order step of a quarter radian errs by 1e-5 of it
_STEPS = 4.0
# viscous friction that the carts of any rig have between them [V s/mm]: on a light track it is fast
_DRAG = 0.02


def _track(a: float, f: float, m: float, z: Any, oz: int, p: Any, o: int) -> float:
    if p[o] == 0.0:
        return a
    w = 2.0 * np.pi * p[o + 1]
    # 1/M; masses that stick on the track move with it
    lightness = p[o] * w * w
    own = w * w * z[oz] + 2.0 * p[o + 2] * w * z[oz + 1]
    return a - (own + lightness * f) / (1.0 + lightness * m)


def _rates(
    w: int, x1: float, v1: float, x2: float, v2: float, u: float, a: float, t: float, z: Any, oz: int, p: Any, o: int
) -> int:
    if p[o] != 0.0:
        z[oz + w], z[oz + 1 + w] = z[oz + 1], a
    return w


def _fastest_rate(values: tuple[float, ...], masses: tuple[float, float]) -> float:
    compliance, frequency, zeta = values
    w = 2.0 * np.pi * frequency
    return _STEPS * w * max(1.0, 2.0 * zeta) + _DRAG * compliance * w * w


EFFECT = Effect(
    id="base_recoil",
    where=("guide",),
    equation="m_i·(dv_i/dt + a_b) = F_i,  M·a_b = -kb·x_b - cb·dx_b/dt - Σ(F_i - Fs_i),  M = kb/ω_b²;  x1, x2 relative to x_b",
    parameters=(
        Parameter("compliance", "mm/V", 0.0, 0.0, 1.0, "1/kb: how far a volt pushes the track", (5e-3, 3e-2)),
        Parameter(
            "frequency", "Hz", 34.0, 2.0, 200.0, "of the track without the carts' masses", (34.0, 26.0), role="shape"
        ),
        Parameter("zeta", "1", 0.05, 0.0, 1.0, "its damping ratio, cb/(2·M·ω_b)", (0.05, 0.5), role="shape"),
    ),
    hooks={"track": _track, "rates": _rates},
    states=("x_b", "v_b"),
    fastest_rate=_fastest_rate,
    tells_itself_by="v1 and v2 jump together within 10 ms of a reversal, a resonance of 20 to 40 Hz in both",
    looks_like=("extra_mode", "motor_gear_backlash"),
    separating_experiment=(
        "fast reversals of the command, many of them, averaged: a track throws both encoders at once, an appendage its own cart; "
        "an accelerometer or a dial gauge on the track"
    ),
    reference=(
        "A. Preumont, Vibration Control of Active Structures, 3rd ed. 2011, sec. 1.3 (reaction on the support); "
        "J. P. Den Hartog, Mechanical Vibrations, 1934, ch. 3"
    ),
)
