r"""The state a run starts in, from its first samples.

A free simulation needs the positions and velocities of all bodies at its first instant. The few samples of an initialisation
window tell them by least squares on what was measured,

.. math:: \min_{s} \sum_{n < w} (y_n - \hat y_n(s))^2 / \sigma_y^2 + \|(s - s_0) / \sigma_s\|^2 ,

with a wide prior about the state read off directly, because a body without a sensor shows only through the others. A sensor
that loses the sign allows two states; both are tried.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from flexdrive_gym.recording import FloatArray
from identification.replay.output_error import Run, simulate_run

# of the prior, in spreads of the measured signal
_WIDE = 3.0


def with_start(values: Mapping[str, float], run: Run, window: int, *, moving: int) -> Run:
    """Return the run with the start state that fits its first samples.

    Parameters
    ----------
    values
        Parameters of the drive.
    window
        Samples that may be used; 0 leaves the run as it is.
    moving
        How many bodies move, 1 or 2.
    """
    if window < 1:
        return run
    head = replace(
        run,
        u=run.u[:window],
        measured=[y[:window] for y in run.measured],
        keep=[k[:window] for k in run.keep],
        track=np.ascontiguousarray(run.track[:, :window]),
        fine=None if run.fine is None else run.fine[: window * len(run.fine) // len(run.u)],
    )
    found = [_fitted(values, head, sign, moving) for sign in (1.0, -1.0)]
    return replace(run, start=min(found, key=lambda item: item[1])[0])


def _fitted(values: Mapping[str, float], run: Run, sign: float, moving: int) -> tuple[FloatArray, float]:
    speed = np.array([_speed(run, c) for c in range(len(run.measured))])
    seen = [c for c in range(len(run.measured)) if run.keep[c].any()]
    known = float(speed[seen[0]])
    start = run.start.copy()
    # a body without a sensor moves like the other
    start[1] = sign * (speed[0] if 0 in seen else known)
    start[3] = sign * (speed[1] if 1 in seen else known) if moving == 2 else 0.0
    level = max(float(np.std(np.concatenate([run.measured[c] for c in seen]))), abs(known), 1e-6)
    free = [0, 1] if moving == 1 else [0, 1, 3]
    spread = _WIDE * np.array([max(1.0, level) if i == 0 else max(level, abs(known)) for i in free])

    def state(z: FloatArray) -> FloatArray:
        s = start.copy()
        s[free] += spread * z
        return s

    def residual(z: FloatArray) -> FloatArray:
        simulated = simulate_run(values, replace(run, start=state(z)))
        error = [(m - s)[k] for m, s, k in zip(run.measured, simulated, run.keep, strict=True)]
        return np.concatenate([*error, 0.01 * level * z])

    fit = least_squares(residual, np.zeros(len(free)), diff_step=np.full(len(free), 1e-4), x_scale=1.0, max_nfev=30)
    return state(fit.x), float(fit.cost)


def _speed(run: Run, cart: int) -> float:
    """Return the speed at the first sample, from a line through the first ones."""
    y, h = run.measured[cart], run.sample_time
    if len(y) < 3:
        return float(run.start[2 * cart + 1])
    if not run.positions:
        return float(np.mean(y[:3]))
    return float(np.polynomial.polynomial.polyfit(np.arange(len(y)) * h, y, 2 if len(y) > 5 else 1)[1])
