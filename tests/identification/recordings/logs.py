"""Logs of a small drive made on the spot, and the files that labs write them to.

The drive is the handout's two masses with dry friction, stepped at the rig's 1 kHz, read by encoders of the
rig's count. It is deliberately not the package's own simulator.
"""

from functools import cache

import numpy as np

from flexdrive_gym.recording import Recording
from identification.recordings import recognise_excitation

COUNT = 0.0046592  # mm
TS = 1e-3  # s
M1, B1, D1 = 4.5e-4, 8e-3, 0.4
M2, B2, D2, K = 2.4e-4, 8e-4, 0.04, 0.09
LIMIT = 8.0


def time(seconds):
    return np.arange(round(seconds / TS) + 1) * TS


def square(t, amplitude=2.0, frequency=0.5):
    return np.where((t * frequency + 1e-9) % 1.0 < 0.5, -amplitude, amplitude)


def sine(t, amplitude=2.5, frequency=2.0):
    return amplitude * np.sin(2.0 * np.pi * frequency * t)


def trajectory(t, length=50.0, period=2.0):
    """There and back with smooth corners, as the lab's reference."""
    phase = t % period / period
    ramp = np.clip(phase / 0.35, 0.0, 1.0) - np.clip((phase - 0.5) / 0.35, 0.0, 1.0)
    return length * ramp * ramp * (3.0 - 2.0 * ramp)


def _rub(v, force, m, b, d, h):
    """Step a speed under a force against viscous and dry friction, which can hold but never reverse it."""
    free = v + h * (force - b * v) / m
    hold = h * d / m
    return 0.0 if abs(free) <= hold else free - np.sign(free) * hold


def positions(command, n, substeps=4):
    """Return both carts' positions [mm], shape (n,), under ``command(k, x1, x2)`` [V]."""
    h = TS / substeps
    p1 = p2 = v1 = v2 = 0.0
    x1, x2, u = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        x1[k], x2[k] = round(p1 / COUNT) * COUNT, round(p2 / COUNT) * COUNT
        u[k] = command(k, x1[k], x2[k])
        for _ in range(substeps):
            pull = K * (p1 - p2)
            v1, v2 = _rub(v1, u[k] - pull, M1, B1, D1, h), _rub(v2, pull, M2, B2, D2, h)
            p1, p2 = p1 + h * v1, p2 + h * v2
    return x1, x2, u


def speed(x):
    """Return the raw difference [mm/s], as the rig logs it."""
    return np.diff(x, prepend=x[0]) / TS


@cache
def open_loop(kind="square", amplitude=2.0, frequency=0.5, seconds=4.0):
    """Return t, u, x1, x2 of an open-loop run; treat them as read-only."""
    t = time(seconds)
    u = (square if kind == "square" else sine)(t, amplitude, frequency)
    x1, x2, _ = positions(lambda k, _1, _2: u[k], t.size)
    for values in (t, u, x1, x2):
        values.flags.writeable = False
    return t, u, x1, x2


@cache
def closed_loop(gain=0.05, seconds=4.0):
    """Return t, u, xr, x1, x2 of a P-controlled run on x2; treat them as read-only."""
    t = time(seconds)
    xr = trajectory(t)
    x1, x2, u = positions(lambda k, _, x: float(np.clip(gain * (xr[k] - x), -LIMIT, LIMIT)), t.size)
    for values in (t, u, xr, x1, x2):
        values.flags.writeable = False
    return t, u, xr, x1, x2


def velocity_log(kind="square", amplitude=2.0, frequency=0.5, seconds=4.0):
    """Return the columns of an open-loop log in the rig's format."""
    t, u, x1, x2 = open_loop(kind, amplitude, frequency, seconds)
    return {"t_s": t, "u_V": u, "v1_mm_s": speed(x1), "v2_mm_s": speed(x2)}


def position_log(gain=0.05):
    """Return the columns of a closed-loop log in the rig's format."""
    t, u, xr, x1, x2 = closed_loop(gain)
    return {"t_s": t, "u_V": u, "xr_mm": xr, "x1_mm": x1, "x2_mm": x2}


def csv_text(columns, separator=","):
    """Return a log as text, rounded like the rig's files."""
    lines = [separator.join(columns)]
    rows = np.column_stack([np.asarray(values, dtype=float) for values in columns.values()])
    lines += [separator.join("" if np.isnan(cell) else f"{cell:.7g}" for cell in row) for row in rows]
    return "\n".join(lines) + "\n"


def write_csv(path, columns, separator=","):
    path.write_text(csv_text(columns, separator))
    return path


def recording(name="run", **changes):
    """Return the standard open-loop run as a Recording, with fields replaced."""
    kind = changes.pop("kind", "square")
    t, u, x1, x2 = open_loop(kind, changes.pop("amplitude", 2.0), changes.pop("frequency", 0.5))
    fields = {"v1": speed(x1), "v2": speed(x2), "quantum": (COUNT, COUNT)} | changes
    return Recording(name, t, u, excitation=recognise_excitation(t, u), **fields)
