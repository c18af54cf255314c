"""Time stamps that increase: without holes, rounding, restarts, repetitions and long gaps.

Loggers lose samples, restart their clocks, round times and write lines out of order. Each is a stage here, which says what it
left out, or refuses what no longer is a time base.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from identification.recordings.errors import broken

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from flexdrive_gym.recording import BoolArray, FloatArray

# of samples, what is kept
Which: TypeAlias = "slice | BoolArray | npt.NDArray[np.intp]"

FEWEST = 50  # samples
JITTER = 0.05  # of the sampling period, beyond which the samples cannot be called uniform
GAP = 1.5  # sampling periods between neighbours, beyond which a sample is missing
LONGEST_GAPS = 0.5  # s in total that may be bridged
SAME = 1e-9  # s: closer stamps are equal but for floating-point noise
MOST_MISSING = 0.2  # of a column that may be interpolated
MOST_REPEATED = 0.05  # of the stamps that may repeat before they are too coarse to be a time base
MOST_DISORDERED = 0.01  # of the samples that may come late
MOST_PIECES = 20  # of a clock that starts again, beyond which it is none
LONG_GAP = 0.02  # s: the spring's swing can be followed over a shorter one
FEWEST_STEPS = 3  # odd steps whose regularity tells rounding from lost samples
BLOCK = 200  # samples over which rounded stamps keep to a line
DRIFT = 5.0  # decimals by which a clock may drift in a run
_EXACT = 0.1  # of its last bit by which a number of single precision may differ from one
COARSEST = 4.0  # sampling periods that a rounded stamp may be coarse
LATEST = 1e12  # s
# s after which clocks begin again: of a day, of µs and of ms in 32 bits
ROUNDS = (86400.0, 2.0**32 * 1e-6, 2.0**32 * 1e-3)
SHORTEST_EXPERIMENT = 1.0  # s
LATE = 10.0  # sampling periods that may be lost meanwhile


def clean_stamps(
    t: FloatArray, signals: dict[str, FloatArray], source: str
) -> tuple[FloatArray, dict[str, FloatArray], list[str]]:
    """Return stamps that increase: without holes, rounding, restarts, repetitions and long gaps."""
    notes: list[str] = []

    def take(stage: Callable[[FloatArray, str], tuple[Which, str] | None]) -> None:
        nonlocal t, signals
        found = stage(t, source)
        if found is not None:
            which, note = found
            t, signals = t[which], {name: values[which] for name, values in signals.items()}
            notes.append(note)

    take(_stamped)
    t, round_ = _gone_round(t)
    notes += round_
    for stage in (_in_order, _of_one_clock):
        take(stage)
    straight = _straightened(t)
    if straight is not None:
        t, note = straight
        return t, signals, [*notes, note]
    for stage in (_unrepeated, _without_long_gaps):
        take(stage)
    return t, signals, notes


def experiments(t: FloatArray) -> list[slice]:
    """Return the experiments that follow each other in one log: where its clock starts again, or long gaps lie between them.

    A log is one experiment if any of its pieces is too short to be one, for then it has lost samples.
    """
    good = np.isfinite(t)
    if not good.all() or t.size < 2 * FEWEST or _disordered(t) is not None:
        return [slice(0, t.size)]
    step = np.diff(_gone_round(t)[0])
    Ts = float(np.median(step))
    found = pieces((step < -SAME) | (step > max(LONGEST_GAPS, LATE * Ts)))
    whole = all(p.stop - p.start >= FEWEST and (p.stop - p.start) * Ts >= SHORTEST_EXPERIMENT for p in found)
    return found if whole and len(found) <= MOST_PIECES else [slice(0, t.size)]


def _stamped(t: FloatArray, source: str) -> tuple[Which, str] | None:
    """Return the samples with a time stamp, and a note, where some have none."""
    good = np.isfinite(t) & (np.abs(np.nan_to_num(t)) < LATEST)
    if good.all():
        return None
    bad = int(np.sum(~good))
    if bad > MOST_MISSING * t.size:
        raise broken(
            source,
            "time",
            f"at most {MOST_MISSING:.0%} of the stamps may be missing",
            f"{bad} of {t.size}",
            "Export the log again with a time for every sample.",
        )
    return good, f"{bad} samples without a time stamp dropped"


def _gone_round(t: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the stamps of a clock that went round as they go on: a day's, or one that counts in 32 bits."""
    step = np.diff(t)
    Ts = float(np.median(step)) if step.size else 0.0
    for period in ROUNDS:
        again = (step < -SAME) & (step + period > SAME) & (step + period < LATE * Ts)
        if again.any() and not np.any((step < -SAME) & ~again):
            turns = np.concatenate([[0.0], np.cumsum(again)])
            return t + period * turns, [f"the clock goes round after {period:.6g} s: read on from there"]
    return t, []


def _in_order(t: FloatArray, _source: str) -> tuple[Which, str] | None:
    """Return the samples sorted by time, and a note, where a few are out of order."""
    disorder = _disordered(t)
    if disorder is None:
        return None
    return np.argsort(t, kind="stable"), f"{disorder.size} samples out of order, sorted by time"


def _of_one_clock(t: FloatArray, source: str) -> tuple[Which, str] | None:
    """Return the longest piece in which time increases, and a note, where a clock starts again."""
    found = pieces(np.diff(t) < -SAME)
    if len(found) == 1:
        return None
    if len(found) > MOST_PIECES:
        k = int(np.argmax(np.diff(t) < -SAME))
        raise broken(
            source,
            "time",
            "must increase",
            f"{t[k + 1]:.6g} s after {t[k]:.6g} s at sample {k + 2}, {len(found) - 1} steps backwards in all",
            "Sort the samples by time, or name the column that holds it.",
        )
    best, note = longest(found)
    return best, f"the clock starts again: {note}"


def _unrepeated(t: FloatArray, source: str) -> tuple[Which, str] | None:
    """Return the samples whose stamp differs from the one before, and a note, where some repeat."""
    fresh = np.r_[True, np.diff(t) > SAME]
    repeated = int(np.sum(~fresh))
    if repeated > MOST_REPEATED * t.size:
        raise broken(
            source,
            "time",
            "stamps must differ from sample to sample",
            f"{repeated} of {t.size} repeat",
            "Export the time with more decimals, or write the sampling period in rig.toml: [rig] sample_time = 0.001.",
        )
    return (fresh, f"{repeated} samples with a repeated time stamp dropped") if repeated else None


def _without_long_gaps(t: FloatArray, _source: str) -> tuple[Which, str] | None:
    """Return the longest piece without long gaps, and a note, where these are too much of the time to be filled."""
    step = np.diff(t)
    Ts = float(np.median(step)) if t.size > 1 else 0.0
    if np.sum(step[step > GAP * Ts] - Ts) <= LONGEST_GAPS:
        return None
    found = pieces(step > max(GAP * Ts, LONG_GAP))
    if not 1 < len(found) <= MOST_PIECES:
        return None
    best, note = longest(found)
    return best, f"gaps of {float(np.sum(step[step > LONG_GAP])):.3g} s in time: {note}"


def _disordered(t: FloatArray) -> npt.NDArray[np.intp] | None:
    """Return the samples that come a little late, as from a network, or ``None`` where the order is another matter."""
    back = np.flatnonzero(np.diff(t) < -SAME)
    if not 0 < back.size <= MOST_DISORDERED * t.size:
        return None
    Ts = float(np.median(np.abs(np.diff(t))))
    ordered = np.sort(t)
    late = bool(np.all(t[back] - t[back + 1] < 10.0 * Ts)) and bool(np.all(np.diff(ordered) > SAME))
    return back if late else None


def pieces(broken_after: BoolArray) -> list[slice]:
    """Return the pieces of samples that some steps between neighbours, shape (n - 1,), part."""
    edges = np.r_[0, np.flatnonzero(broken_after) + 1, broken_after.size + 1]
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def longest(found: list[slice]) -> tuple[slice, str]:
    """Return the longest piece, the first of several, and a note that says which it is."""
    best = max(found, key=lambda p: p.stop - p.start)
    return best, f"of {len(found)} pieces the longest is read, samples {best.start + 1} to {best.stop}"


def _straightened(t: FloatArray) -> tuple[FloatArray, str] | None:
    """Return the instants of uniform samples whose stamps were rounded, or ``None`` where they are something else.

    Rounding makes longer and shorter steps alternate regularly and keeps within half a decimal of a line, wherever one looks;
    over a whole run a controller's clock may drift by some decimals. A lost sample does neither.
    """
    if t.size < FEWEST:
        return None
    step = np.diff(t)
    Ts = float(np.median(step))
    if float(np.max(np.abs(step - Ts))) <= JITTER * Ts:
        return None
    decimal = _resolution(t)
    period = float(t[-1] - t[0]) / (t.size - 1)
    spacing = np.diff(np.flatnonzero(np.abs(step - Ts) > 0.5 * decimal))
    if not 0.0 < decimal <= COARSEST * period or spacing.size < FEWEST_STEPS:
        return None
    if np.max(spacing) > 1.5 * np.min(spacing) + 2:
        return None
    blocks = t[: t.size // BLOCK * BLOCK].reshape(-1, BLOCK) if t.size >= BLOCK else t[None]
    if _off_line(blocks) > 0.55 * decimal or _off_line(t[None]) > DRIFT * decimal:
        return None
    note = f"time stamps rounded to {decimal:g} s, uniform at {period:.6g} s by span over samples"
    return t[0] + period * np.arange(t.size), note


def _off_line(t: FloatArray) -> float:
    """Return by how much stamps miss the line through each row of them [s], ndarray, shape (rows, n)."""
    count = np.arange(t.shape[1]) - 0.5 * (t.shape[1] - 1)
    off = t - t.mean(axis=1, keepdims=True)
    off -= (off @ count / (count @ count))[:, None] * count
    return float(np.max(np.abs(off)))


def _resolution(t: FloatArray) -> float:
    """Return the decimal, or the last bit of single precision, that the stamps are rounded to [s]; 0 where they are not."""
    single = t.astype(np.float32)
    bit = np.spacing(np.abs(single)).astype(np.float64)
    # they may have been written down with some digits less
    if np.all(np.abs(t - single) <= _EXACT * bit):
        return float(np.max(bit))
    for decimal in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        scaled = t / decimal
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-4:
            return decimal
    return 0.0
