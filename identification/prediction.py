"""Multi-step prediction: replay of a recording over short windows, each begun in the measured state.

A free replay of a command that feedback made drifts with any error of friction, because what held the cart in place is not
simulated; where the controller is unknown it cannot be simulated either. Over a window of about one period of the drive's own
vibration the drift has no time to grow, and what the model does wrong in that time is seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import FloatArray
from identification.replay.output_error import Run, prepare, simulate_run

# least and greatest length of a window [s], and that for a drive that does not vibrate
_SHORTEST, _LONGEST, _RIGID = 0.2, 1.0, 0.5
# what a speed is measured over, to either side [s]
_AROUND_S = 0.01


def window_of(drive: Drive) -> float:
    """Return the length of a window [s]: one period of the drive's vibration, within 0.2 to 1 s; 0.5 s for one cart alone."""
    if drive.carts == 1:
        return _RIGID
    omega = drive.linear.omega_n
    return float(np.clip(2.0 * np.pi / omega, _SHORTEST, _LONGEST)) if omega > 0.0 else _RIGID


def predict(drive: Drive, recording: Recording, window: float | None = None) -> Recording:
    """Return the drive's answer to a recorded command, begun anew in the measured state every ``window`` seconds.

    Parameters
    ----------
    drive
        The model.
    recording
        Any run; a cart that was not measured is taken to begin every window as the other one.
    window
        Length of the windows [s]; default: :func:`window_of`.

    Returns
    -------
    Recording
        With those of x1, x2, v1, v2 that were recorded, or from which a recorded one was made.
    """
    run = prepare(recording)
    steps = max(2, round((window or window_of(drive)) / recording.sample_time))
    states = _states(recording, run, two=drive.carts == 2)
    offset = states[:, 0].copy() if drive.carts == 2 else np.zeros(4)
    offset[[1, 3]] = 0.0
    parts = [
        _window(drive.values, run, states - offset[:, None], start, min(start + steps, recording.n))
        for start in range(0, recording.n, steps)
    ]
    places, speeds = (np.hstack([part[i] for part in parts]) for i in (0, 1))
    given = {"x1": recording.x1, "x2": recording.x2, "v1": recording.v1, "v2": recording.v2}
    signals: dict[str, FloatArray] = {}
    for cart in range(len(places)):
        if given[f"x{cart + 1}"] is not None:
            signals[f"x{cart + 1}"] = places[cart] + offset[2 * cart]
        if given[f"v{cart + 1}"] is not None:
            signals[f"v{cart + 1}"] = speeds[cart]
    return Recording(
        recording.name,
        recording.t,
        recording.u,
        **signals,  # type: ignore[arg-type]
        xr=recording.xr,
        excitation=recording.excitation,
        source="simulated",
        units=recording.units,
    )


def _states(recording: Recording, run: Run, *, two: bool) -> FloatArray:
    """Return x1, v1, x2, v2 at every sample as they were measured, ndarray, shape (4, n)."""
    h, n = recording.sample_time, recording.n
    half = min(max(2, round(_AROUND_S / h)), (n - 1) // 2)
    rows: list[FloatArray | None] = []
    for cart, x in enumerate((recording.x1, recording.x2)):
        if cart >= len(run.measured) or not run.keep[cart].any():
            rows += [None, None]
            continue
        place = x
        if place is None:
            v = savgol_filter(run.measured[cart], 2 * half + 1, 1)
            place = np.cumsum(np.where(run.keep[cart], run.measured[cart], v)) * h
        else:
            v = savgol_filter(place, 2 * half + 1, 2, deriv=1, delta=h)
        rows += [place, v]
    rows += [None] * (4 - len(rows))
    zero = np.zeros(n)
    first, second = rows[:2], rows[2:]
    if first[0] is None:
        first = second
    elif second[0] is None:
        second = first if two else [zero, zero]
    return np.vstack([row if row is not None else zero for row in (*first, *second)])


def _window(
    values: Mapping[str, float], run: Run, states: FloatArray, start: int, end: int
) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of one window, two ndarrays, shape (carts, samples)."""
    pieces = 1 if run.fine is None else len(run.fine) // len(run.u)
    part = replace(
        run,
        u=np.ascontiguousarray(run.u[start:end]),
        measured=[y[start:end] for y in run.measured],
        keep=[k[start:end] for k in run.keep],
        track=np.ascontiguousarray(run.track[:, start:end]),
        fine=None if run.fine is None else run.fine[start * pieces : end * pieces],
        start=np.ascontiguousarray(states[:, start]),
    )
    places = np.vstack(simulate_run(values, replace(part, positions=True)))
    speeds = np.vstack(simulate_run(values, replace(part, positions=False)))
    return places, speeds
