r"""Margins of any controller by trial: raise the loop gain, or hold the command back, until the response grows.

Nothing is asked of the controller but the protocol, so the same trial serves P-control, an observer or a learnt policy. On the
*linear* drive (friction, encoder counts and command limit off) the response to a displaced start decays below the margin and
grows beyond it, whatever its size: the trial compares the size of the motion in two late windows. On the *full* drive the
limit depends on amplitude; there the contract's rule decides (the handout's first move, then held for 12 s: unstable if x2
swings more than 25 mm within the last 6 s), and one line more: the command at its limit for a tenth of that time fails too,
because a loop faster than P-control vibrates between the limits without swinging that far.

A linear controller and a policy that answers for many are tried many gains or delays at once. The whole samples of a delay are
held back between controller and drive, the rest is the drive's own input delay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, nan
from typing import Literal

import numpy as np

from baselines.evaluation.rollout import run_many, runs_in_batch
from baselines.loop_analysis.loops import linear_part
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import Controller, Drive, LinearController
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import point_to_point
from flexdrive_gym.units import measured_in

On = Literal["linear", "full"]

LARGEST_GAIN = 200.0
LARGEST_DELAY_S = 1.0
_START_MM = 1.0
_DURATION_S = 12.0
_WINDOW_S = 6.0
SWING_MM = 25.0
_PRECISION = 2e-3
_FAR_MM = 1e6
_AT_ONCE = 14
# of the samples at the end; a loop that holds a reference needs the limit for none
_LIMITED_SHARE = 0.1


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
    swing
        Of the cart that swings most in the last six seconds of the trial with nothing changed, peak to peak [mm]: what vibration
        stays. On the linear drive it is what is left of the start.
    """

    gain_margin: float
    delay_margin: float = field(metadata=measured_in("s"))
    on: On
    swing: float = field(default=nan, metadata=measured_in("mm"))


class NoMarginsError(ValueError):
    """The loop grows as it is.

    Attributes
    ----------
    swing
        As in :class:`EmpiricalMargins`; inf where the motion leaves all bounds.
    """

    def __init__(self, message: str, swing: float) -> None:
        super().__init__(message)
        self.swing = swing

    def __reduce__(self) -> tuple[type[NoMarginsError], tuple[str, float]]:
        """Travel between processes with both arguments."""
        return NoMarginsError, (str(self), self.swing)


def _split(drive: Drive, delay: float, sample_time: float) -> tuple[Drive, int]:
    """Return the drive with the fraction of a sample as input delay, and the whole samples."""
    whole = int(delay / sample_time + 1e-9)
    rest = delay - whole * sample_time
    if rest <= 1e-12:
        return drive, whole
    return drive.replace({"input_delay.tau": drive["input_delay.tau"] + rest}), whole


def _runs(
    drive: Drive, controller: Controller, gains: Sequence[float], delays: Sequence[float], xr: FloatArray,
    start: FloatArray, sample_time: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Run every pair of gain and delay; return x1, x2 (x1 if rigid) and the command, ndarray, shape (pairs, n)."""
    drives, late = zip(*(_split(drive, delay, sample_time) for delay in delays), strict=True)
    out = run_many(controller, drives, xr, gains=gains, late=late, start=start, sample_time=sample_time)
    return np.asarray(out[:, 0]), np.asarray(out[:, 2 if drive.carts == 2 else 0]), np.asarray(out[:, 4])


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


def _grows_full(x: FloatArray, u: FloatArray, limit: float, sample_time: float) -> bool:
    """Whether the second cart swings too far at the end, or the command vibrates between its limits."""
    late = slice(-round(_WINDOW_S / sample_time), None)
    if not np.max(np.abs(x[late])) < _FAR_MM or float(np.ptp(x[late])) > SWING_MM:
        return True
    return float(np.mean(np.abs(u[late]) > 0.999 * limit)) > _LIMITED_SHARE


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
        Anything with the protocol.
    on
        ``linear``: friction, encoder counts, command limit and every other effect off but the input delay. ``full``: the drive
        as it is, on the handout's rig.
    sample_time
        Of the rig [s].
    duration
        Of one trial [s].
    quantities
        Which margins to find; the others are nan.

    Raises
    ------
    NoMarginsError
        If the loop already grows without any change.
    """
    plant = linear_part(drive) if on == "linear" else with_rig(drive)
    n = round(duration / sample_time)
    if on == "linear":
        xr, start = np.zeros(n), np.array([_START_MM, 0.0, _START_MM if drive.carts == 2 else 0.0, 0.0])
    else:
        xr, start = point_to_point(np.arange(n) * sample_time), np.zeros(4)
    if isinstance(controller, LinearController) and on == "linear":
        controller = controller.replace(limit=inf, friction=0.0, shaper=((0, 1.0),))

    late = slice(-round(_WINDOW_S / sample_time), None)
    swing: float | None = None

    def grows(gains: Sequence[float], delays: Sequence[float]) -> list[bool]:
        nonlocal swing
        first, x, u = _runs(plant, controller, gains, delays, xr, start, sample_time)
        if swing is None:  # the first trial changes nothing
            both = np.array([first[0, late], x[0, late]])
            swing = float(np.max(np.ptp(both, axis=1))) if np.max(np.abs(both)) < _FAR_MM else inf
        # a run that leaves all bounds is a run that grows
        with np.errstate(over="ignore", invalid="ignore"):
            if on == "linear":
                return [_grows_linear(row) for row in x]
            limit = plant.voltage_limit
            return [_grows_full(*pair, limit, sample_time) for pair in zip(x, u, strict=True)]

    if grows([1.0], [0.0])[0]:
        raise NoMarginsError(
            f"controller: the loop on {plant.name!r} grows as it is; it has no margins.",
            inf if swing is None else swing,
        )
    at_once = _AT_ONCE if runs_in_batch(controller) else 1
    gain_margin = delay_margin = float("nan")
    if "gain" in quantities:
        scan = np.geomspace(1.0, LARGEST_GAIN, 41)
        gain_margin = _largest(lambda values: grows(values, [0.0] * len(values)), scan, at_once)
    if "delay" in quantities:
        scan = np.geomspace(sample_time, LARGEST_DELAY_S, 41)
        delay_margin = _largest(lambda values: grows([1.0] * len(values), values), scan, at_once)
    return EmpiricalMargins(gain_margin, delay_margin, on, inf if swing is None else swing)


def _largest(grows: Callable[[Sequence[float]], list[bool]], scan: FloatArray, at_once: int) -> float:
    """Return the largest value below the first that grows, to 0.2 %; inf where none of the scan does.

    ``at_once`` values are tried in one call where that costs little more than one.
    """
    low, high = 0.0, inf
    for portion in np.array_split(scan, -(-len(scan) // at_once)):
        low, high = _narrowed(grows, list(map(float, portion)), low, high)
        if isfinite(high):
            break
    if not isfinite(high):
        return inf
    while high > low * (1.0 + _PRECISION) and high > 1e-6:
        # without a lower end, halves of the upper one
        inside = np.geomspace(low if low > 0.0 else high / 4.0, high, at_once + 2)[1:-1]
        low, high = _narrowed(grows, list(map(float, inside)), low, high)
    return float(np.sqrt(low * high)) if low > 0.0 else 0.0


def _narrowed(
    grows: Callable[[Sequence[float]], list[bool]], values: list[float], low: float, high: float
) -> tuple[float, float]:
    """Return the bracket of the first value that grows, within the one known."""
    hit = grows(values)
    first = hit.index(True) if any(hit) else len(values)
    return values[first - 1] if first else low, values[first] if first < len(values) else high
