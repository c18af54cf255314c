"""The concealed rig's true limits by the contract's rule: critical gain of P-control, gain margin of any controller.

The rule is that of a simulated limit: the handout's first forward move of 50 mm, then held, 12 s; unstable if x2 swings more
than 25 mm peak to peak within the last 6 s; the first unstable gain of a scan, bisected. The rig is
:func:`~baselines.rig_simulator.trials.undisturbed`.

A loop faster than P-control vibrates faster, and ±8 V can then hardly swing 25 mm, while dry friction brings it to rest however
far beyond its linear limit it is. The rule thus says little of its margin. :func:`gain_margin` can therefore leave the dry
friction out, as linear theory does, and takes a vibration that has not died out for what it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from baselines.rig_simulator.ingredients import rig_values
from baselines.rig_simulator.kernel import LIMIT_V, SAMPLE_S, FloatArray
from baselines.rig_simulator.rig import Law, p_law, run
from baselines.rig_simulator.trials import undisturbed
from baselines.rig_simulator.truth import Truth

SMALLEST_GAIN, LARGEST_GAIN, SCAN = 1e-3, 10.0, 81
SECONDS, WINDOW_S, SWING_MM = 12.0, 6.0, 25.0
PRECISION = 2e-3
STROKE_MM, SPEED_MM_S, ACCELERATION_MM_S2 = 50.0, 100.0, 500.0
# factors of a gain margin: below 1 for loops that are unstable as they are
SMALLEST_FACTOR, LARGEST_FACTOR, FACTOR_PRECISION = 0.05, 20.0, 0.02
RINGING_MM, RINGING_SHARE = 1.0, 0.01
# all that makes dry friction; a hump, an asymmetry and the like are relative to its level
_DRY = ("d1", "d2", "bristle1", "bristle2", "load1", "load2", "push_friction")


def one_move(t: FloatArray) -> FloatArray:
    """Return the handout's first move [mm]: a trapezoid of velocity, 50 mm in 0.7 s, then held."""
    ramp = SPEED_MM_S / ACCELERATION_MM_S2
    cruise = STROKE_MM / SPEED_MM_S - ramp
    speed = np.interp(t, [0.0, ramp, ramp + cruise, 2.0 * ramp + cruise], [0.0, SPEED_MM_S, SPEED_MM_S, 0.0])
    # the corners lie on samples, so that the sum of trapezoids is exact
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _trial(truth: Truth, law: Law, *, friction: bool = True) -> Callable[[float], bool]:
    """Return the trial that says whether the loop is unstable with a factor on the controller's command."""
    t: FloatArray = np.arange(round(SECONDS / SAMPLE_S), dtype=np.float64) * SAMPLE_S
    xr = one_move(t)
    values, world, tail = rig_values(truth), undisturbed(truth, len(xr)), round(WINDOW_S / SAMPLE_S)
    if not friction:
        values |= dict.fromkeys(_DRY, 0.0)
        law = replace(law, friction=0.0)

    def unstable(factor: float) -> bool:
        # the limit stays where it is while the gain before it changes, and the controller knows
        motion = run(values, world, xr, controller=replace(law, limit=law.limit / factor), factor=factor)
        late, swing = motion.u[-tail:], float(np.ptp(motion.states[2, -tail:]))
        if friction:
            return swing > SWING_MM
        touches = float(np.mean(np.abs(late) > 0.999 * min(law.limit, LIMIT_V)))
        return swing > RINGING_MM or touches > RINGING_SHARE

    return unstable


def _first(unstable: Callable[[float], bool], scan: FloatArray, precision: float) -> float | None:
    """Return the smallest unstable value of a scan, bisected; ``None`` where all are stable."""
    first = next((i for i, value in enumerate(scan) if unstable(float(value))), None)
    if first is None:
        return None
    if first == 0:
        return float(scan[0])
    low, high = float(scan[first - 1]), float(scan[first])
    while high > low * (1.0 + precision):
        between = math.sqrt(low * high)
        low, high = (low, between) if unstable(between) else (between, high)
    return math.sqrt(low * high)


def critical_gain(truth: Truth, feedback: int = 2) -> float | None:
    """Return the smallest gain at which P-control of the concealed rig is unstable, to 0.2 %.

    Parameters
    ----------
    truth
        Its effects act, its nuisance does not.
    feedback
        The encoder P-control reads, 1 or 2.

    Returns
    -------
    float or None
        Kp [V/mm]; ``None`` where no limit exists below 10 V/mm.
    """
    return _first(
        _trial(truth, p_law(1.0, feedback)), np.geomspace(SMALLEST_GAIN, LARGEST_GAIN, SCAN), PRECISION
    )  # fmt: skip


def gain_margin(truth: Truth, law: Law, *, friction: bool = True) -> float | None:
    """Return the smallest factor on a controller's command that makes the concealed rig unstable, to 2 %.

    Parameters
    ----------
    truth
        Its effects act, its nuisance does not.
    law
        The controller.
    friction
        With the rig's dry friction and the contract's rule; without, the loop is unstable if x2 still swings more than 1 mm, or
        the command still touches its limit, in the last 6 s.

    Returns
    -------
    float or None
        []; below 1 for a loop that is unstable as it is, ``None`` where a factor of 20 is stable.
    """
    unstable = _trial(truth, law, friction=friction)
    # upwards from 1, and below it only where need be: a small gain may be unstable in its own right, on an integrator
    if unstable(1.0):
        return _first(unstable, np.geomspace(SMALLEST_FACTOR, 1.0, 11), FACTOR_PRECISION)
    return _first(unstable, np.geomspace(1.0, LARGEST_FACTOR, 11), FACTOR_PRECISION)
