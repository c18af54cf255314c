r"""Margins of any controller by trial: raise the loop gain, or hold the command back, until the response grows.

Nothing is asked of the controller but the protocol, so the same trial serves P-control, an observer or a learnt policy. On the
*linear* drive (friction, encoder counts and command limit off) the response to a displaced start decays below the margin and
grows beyond it, whatever its size: the trial compares the size of the motion in two late windows. On the *full* drive the
limit depends on amplitude; there the contract's rule decides (the handout's first move, then held for 12 s: unstable if x2
swings more than 25 mm within the last 6 s).

A linear controller is tried in the compiled loop, all gains of a sweep in one call. The whole samples of a delay are held back
between controller and drive, the rest is the drive's own input delay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal

import numpy as np

from baselines.loops import linear_part
from baselines.stability_limit import with_rig
from flexdrive_gym import Controller, Drive, LinearController, Observation
from flexdrive_gym.drive.linear_controller import run_batch
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import point_to_point

On = Literal["linear", "full"]

LARGEST_GAIN = 200.0
LARGEST_DELAY_S = 1.0
_START_MM = 1.0
_DURATION_S = 12.0
_WINDOW_S = 6.0
_SWING_MM = 25.0
_PRECISION = 2e-3
_FAR_MM = 1e6


@dataclass(frozen=True)
class EmpiricalMargins:
    """What trials say.

    Attributes
    ----------
    gain_margin
        Largest factor on the command that does not let the response grow []; inf where 200 does not.
    delay_margin
        Largest delay of the command [s]; inf where 1 s does not.
    on
        ``linear`` or ``full`` drive.
    """

    gain_margin: float
    delay_margin: float
    on: On


@dataclass
class _Held:
    """A controller whose command is scaled and held back by whole samples."""

    inner: Controller
    gain: float
    late: int

    def __post_init__(self) -> None:
        self._queue: list[float] = []

    def reset(self) -> None:
        reset = getattr(self.inner, "reset", None)
        if reset is not None:
            reset()
        self._queue = [0.0] * self.late

    def __call__(self, observation: Observation, /) -> float:
        self._queue.append(self.gain * float(self.inner(observation)))
        return self._queue.pop(0)


def _split(drive: Drive, delay: float, sample_time: float) -> tuple[Drive, int]:
    """Return the drive with the fraction of a sample as input delay, and the whole samples."""
    whole = int(delay / sample_time + 1e-9)
    rest = delay - whole * sample_time
    if rest <= 1e-12:
        return drive, whole
    return drive.replace({"input_delay.tau": drive["input_delay.tau"] + rest}), whole


def _positions(
    drive: Drive, controller: Controller, gains: Sequence[float], delay: float, xr: FloatArray, start: FloatArray,
    sample_time: float,
) -> FloatArray:  # fmt: skip
    """Run every gain; return x2 (x1 if rigid), ndarray, shape (gains, n)."""
    late_drive, late = _split(drive, delay, sample_time)
    row = 2 if drive.carts == 2 else 0
    if isinstance(controller, LinearController) and controller.sample_time == sample_time:
        out = run_batch([late_drive] * len(gains), xr, controller, gains=gains, late=late, start=start)
        return np.asarray(out[:, row])
    t = np.arange(len(xr)) * sample_time
    runs = [
        late_drive.simulate_closed_loop(t, xr, _Held(controller, gain, late), start=start, travel_limit=1e6)
        for gain in gains
    ]
    found = []
    for run in runs:
        x = run.x2 if drive.carts == 2 else run.x1
        assert x is not None
        # a run that left every travel grew
        found.append(np.append(x, np.full(len(xr) - len(x), inf)))
    return np.array(found)


def _grows_linear(x: FloatArray) -> bool:
    """Whether the motion is larger in the last third than in one before it.

    Larger than in the middle: it grows freely. Larger than in the first: it grew as far as a controller's own limit let it.
    """
    if not np.max(np.abs(x)) < _FAR_MM:  # nan is far too
        return True
    third = len(x) // 3
    # differences: a slow drift towards rest shall not hide a small vibration that grows
    first, middle, last = (
        float(np.sqrt(np.mean(np.diff(part) ** 2))) for part in (x[:third], x[third : 2 * third], x[2 * third :])
    )
    return last > min(first, middle) > 0.0


def _grows_full(x: FloatArray, sample_time: float) -> bool:
    tail = x[-round(_WINDOW_S / sample_time) :]
    return not np.max(np.abs(tail)) < _FAR_MM or float(np.ptp(tail)) > _SWING_MM


def empirical_margins(
    drive: Drive,
    controller: Controller,
    *,
    on: On = "linear",
    sample_time: float = 1e-3,
    duration: float = _DURATION_S,
    quantities: Sequence[Literal["gain", "delay"]] = ("gain", "delay"),
) -> EmpiricalMargins:
    """Find the gain and delay margin of a controller by trial.

    Parameters
    ----------
    drive
        The drive; ``on`` says what of it is simulated.
    controller
        Anything with the protocol; a linear one runs in the compiled loop.
    on
        ``linear``: friction, encoder counts, command limit and every other effect off but the input delay. ``full``: the drive
        as it is, on the handout's rig.
    sample_time
        Control period [s].
    duration
        Of one trial [s].
    quantities
        Which margins to find; the others are nan.

    Raises
    ------
    ValueError
        If the loop already grows without any change.
    """
    plant = linear_part(drive) if on == "linear" else with_rig(drive)
    n = round(duration / sample_time)
    if on == "linear":
        xr, start = np.zeros(n), np.array([_START_MM, 0.0, _START_MM if drive.carts == 2 else 0.0, 0.0])
    else:
        xr, start = point_to_point(np.arange(n) * sample_time), np.zeros(4)
    # what previews its reference must hear which it is
    following = getattr(controller, "following", None)
    if following is not None:
        controller = following(xr)
    if isinstance(controller, LinearController) and on == "linear":
        controller = controller.replace(limit=inf, friction=0.0, shaper=((0, 1.0),))

    def grows(gains: Sequence[float], delay: float) -> list[bool]:
        x = _positions(plant, controller, gains, delay, xr, start, sample_time)
        return [_grows_linear(row) if on == "linear" else _grows_full(row, sample_time) for row in x]

    if grows([1.0], 0.0)[0]:
        raise ValueError(f"controller: the loop on {plant.name!r} grows as it is; it has no margins.")
    gain_margin = delay_margin = float("nan")
    if "gain" in quantities:
        gain_margin = _largest(lambda values: grows(values, 0.0), np.geomspace(1.0, LARGEST_GAIN, 41))
    if "delay" in quantities:
        scan = np.geomspace(sample_time, LARGEST_DELAY_S, 41)
        delay_margin = _largest(lambda values: [grows([1.0], v)[0] for v in values], scan)
    return EmpiricalMargins(gain_margin, delay_margin, on)


def _largest(grows: Callable[[Sequence[float]], list[bool]], scan: FloatArray) -> float:
    """Return the largest value below the first that grows, to 0.2 %; inf where none of the scan does."""
    low = 0.0
    high = inf
    # in portions, so that a limit near the start is found without trying all
    for portion in np.array_split(scan[scan > 0.0], 8):
        hit = grows(list(map(float, portion)))
        if any(hit):
            i = hit.index(True)
            high = float(portion[i])
            low = float(portion[i - 1]) if i else low
            break
        low = float(portion[-1])
    if not isfinite(high):
        return inf
    while high > low * (1.0 + _PRECISION) and high > 1e-6:
        middle = float(np.sqrt(low * high)) if low > 0.0 else 0.5 * high
        low, high = (low, middle) if grows([middle])[0] else (middle, high)
    return float(np.sqrt(low * high)) if low > 0.0 else 0.0
