"""Reference trajectories and excitations of the laboratory.

Each function takes instants t [s] and returns values at them, so any sample time will do.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray

# the handout's move: 50 mm at 100 mm/s and 500 mm/s², forward at 0 s, back at 1 s, every 2 s
STROKE_MM = 50.0
SPEED_MM_S = 100.0
ACCELERATION_MM_S2 = 500.0
DWELL_UNTIL_S = 1.0
PERIOD_S = 2.0


def point_to_point(
    t: npt.ArrayLike,
    stroke: float = STROKE_MM,
    speed: float = SPEED_MM_S,
    acceleration: float = ACCELERATION_MM_S2,
) -> FloatArray:
    """Return a move from 0 to ``stroke`` with a trapezoidal velocity, then held.

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s]; the move starts at 0.
    stroke, speed, acceleration
        Length [mm], cruising speed [mm/s] and acceleration [mm/s²]; the speed is not reached if the stroke is short.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    times = np.asarray(t, dtype=np.float64)
    peak = min(speed, float(np.sqrt(stroke * acceleration)))
    ramp = peak / acceleration
    total = stroke / peak + ramp
    rising = np.clip(times, 0.0, ramp)
    cruise = np.clip(times - ramp, 0.0, total - 2.0 * ramp)
    falling = np.clip(times - (total - ramp), 0.0, ramp)
    return np.asarray(0.5 * acceleration * rising**2 + peak * cruise + peak * falling - 0.5 * acceleration * falling**2)


def handout_trajectory(t: npt.ArrayLike) -> FloatArray:
    """Return the trajectory of labs 3 and 4: 50 mm forth and back with dwells, repeating every 2 s [mm]."""
    phase = np.mod(np.asarray(t, dtype=np.float64), PERIOD_S)
    return np.asarray(point_to_point(phase) - point_to_point(phase - DWELL_UNTIL_S))


def square(t: npt.ArrayLike, amplitude: float, frequency: float) -> FloatArray:
    """Return a square wave ±amplitude that starts with its positive half period."""
    # a sample that falls on an edge belongs to the half period that begins there, whatever round-off says
    phase = np.mod(np.asarray(t, dtype=np.float64) * frequency + 1e-9, 1.0)
    return np.where(phase < 0.5, amplitude, -amplitude)


def sine(t: npt.ArrayLike, amplitude: float, frequency: float) -> FloatArray:
    """Return amplitude·sin(2π·frequency·t)."""
    return np.asarray(amplitude * np.sin(2.0 * np.pi * frequency * np.asarray(t, dtype=np.float64)))
