"""From the time stamps of a log to a uniform time base.

Simulation and identification take one sampling period for the whole run, so the stamps are checked and,
where they are not uniform, the signals are resampled: measurements and reference linearly, the command
held, because the digital-to-analogue converter holds it. What had to be invented on the way, across gaps
and missing values, is returned as spans to be masked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from identification.recordings.errors import broken
from identification.recordings.stamps import (
    FEWEST,
    GAP,
    JITTER,
    LONGEST_GAPS,
    MOST_MISSING,
    clean_stamps,
    longest,
    pieces,
)

if TYPE_CHECKING:
    from flexdrive_gym.recording import BoolArray, FloatArray

SHORTEST = 0.2  # s: below this not even the spring's first swing (about 3 Hz) is seen
SLOWEST = 0.5  # s per sample: no log of this drive is so slow; stamps in ms labelled s are
UNEVEN = 1e-3  # of the sampling period, below which stamps are left as they are
MOST_INVENTED = 1.5  # samples on the grid for one in the file
LOST = 2.5  # sampling periods between neighbours, from which on more than one sample is missing
UNKNOWN = 0.02  # of the impulse that a command makes otherwise, that it may have made in a gap
STRETCH = 0.01  # by which a given sampling period may differ from the stamps


@dataclass(frozen=True)
class Uniform:
    """Signals on a uniform time base.

    Attributes
    ----------
    t
        Time [s], ndarray, shape (n,).
    signals
        The other signals by name, each ndarray, shape (n,), finite.
    missing
        Spans (first, last instant) [s] whose values are interpolated, by signal; ``""`` for all signals.
    notes
        What was found and done.
    """

    t: FloatArray
    signals: dict[str, FloatArray]
    missing: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def make_uniform(
    t: FloatArray, signals: dict[str, FloatArray], source: str, sample_time: float | None = None
) -> Uniform:
    """Check the time stamps and put the signals on a uniform time base.

    Parameters
    ----------
    t
        Time stamps [s], ndarray, shape (n,); may hold NaN.
    signals
        The other signals, each ndarray, shape (n,); may hold NaN.
    source
        File name for messages.
    sample_time
        Sampling period [s] that holds instead of the stamps.

    Returns
    -------
    Uniform

    Raises
    ------
    RecordingError
        If the stamps do not increase, look like another unit, leave out too much, or span too little, or a column has too many
        missing values.
    """
    if sample_time is not None:
        t, notes = _counted(t, sample_time)
    else:
        t, signals, notes = clean_stamps(t, signals, source)
    Ts = _sample_time(t, source)
    signals, empty = _without_empty(signals)
    notes += empty
    t, signals, cut = _without_unknown_commands(t, signals, Ts)
    notes += cut
    gaps, gap_notes = _gaps(t, Ts, source)
    signals, missing = _fill(t, signals, source)
    step, resample, jitter_notes = _regularity(t, Ts, gaps, source)
    notes += [*gap_notes, *jitter_notes]
    for where in np.flatnonzero(gaps):
        missing.setdefault("", []).append((float(t[where] + Ts), float(t[where + 1] - Ts)))
    if resample:
        t, signals = _resample(t, signals, step, gaps)
    else:
        t = _evened(t)
    return Uniform(t, signals, missing, tuple(notes))


def _evened(t: FloatArray) -> FloatArray:
    """Return stamps without the little jitter that their numbers' digits leave, as of days since the year 0."""
    period = float(t[-1] - t[0]) / (t.size - 1)
    if np.max(np.abs(np.diff(t) - period)) <= UNEVEN * period:
        return t
    even: FloatArray = t[0] + period * np.arange(t.size)
    return even


def _counted(t: FloatArray, Ts: float) -> tuple[FloatArray, list[str]]:
    """Return stamps that a given sampling period makes, and a note where the file's own say otherwise."""
    good = t[np.isfinite(t)]
    own = float(good[-1] - good[0]) / (good.size - 1) if good.size > 1 else Ts
    notes = []
    if abs(own - Ts) > STRETCH * Ts:
        alarm = "warning: " if abs(own - Ts) > 0.1 * Ts else ""
        notes.append(f"{alarm}the sampling period is {Ts:g} s by rig.toml, {own:.6g} s by the time stamps")
    counted: FloatArray = Ts * np.arange(t.size, dtype=np.float64)
    return counted, notes


def _sample_time(t: FloatArray, source: str) -> float:
    """Return the median step, after checking that the stamps look like seconds and are enough."""
    Ts = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    if Ts >= SLOWEST:
        raise broken(
            source,
            "time",
            f"the sampling period must be below {SLOWEST:g} s",
            f"{Ts:.4g} s",
            "The stamps look like milliseconds: rename the column t_ms.",
        )
    if t.size < FEWEST or t[-1] - t[0] < SHORTEST:
        span = float(t[-1] - t[0]) if t.size else 0.0
        unit = " The stamps may be seconds although the name says a smaller unit." if 0 < Ts < 2e-5 else ""
        raise broken(
            source,
            "time",
            f"a recording must last {SHORTEST:g} s and {FEWEST} samples",
            f"{span:.4g} s and {t.size} samples",
            f"Record longer.{unit}",
        )
    return Ts


def _gaps(t: FloatArray, Ts: float, source: str) -> tuple[BoolArray, list[str]]:
    """Return which steps jump over missing samples."""
    step = np.diff(t)
    gaps = step > GAP * Ts
    total = float(np.sum(step[gaps] - Ts))
    where = np.flatnonzero(gaps)
    listing = ", ".join(f"{step[k]:.4g} s at {t[k]:.4g} s" for k in where[:3])
    listing += f" and {where.size - 3} more" if where.size > 3 else ""
    if total > LONGEST_GAPS:
        raise broken(
            source,
            "time",
            f"gaps may add up to {LONGEST_GAPS:g} s",
            f"{total:.3g} s ({listing})",
            "Record again without losing samples, or split the file at the gaps.",
        )
    return gaps, [f"gaps in time, bridged and masked: {listing}"] if where.size else []


def _regularity(t: FloatArray, Ts: float, gaps: BoolArray, source: str) -> tuple[float, bool, list[str]]:
    """Return the grid step, whether the signals must be resampled onto it, and a note."""
    step = np.diff(t)[~gaps]
    jitter = float(np.max(np.abs(step - Ts))) / Ts
    mean = Ts if jitter <= JITTER else float(np.mean(step))
    notes = (
        [] if jitter <= JITTER else [f"jitter of up to {jitter:.0%} of the sampling period, resampled to {mean:.6g} s"]
    )
    resample = bool(gaps.any()) or jitter > JITTER
    if resample and float(t[-1] - t[0]) / mean > MOST_INVENTED * t.size:
        rule = "most samples must have been recorded, not interpolated"
        got = f"{t.size} samples in {float(t[-1] - t[0]):.4g} s at {mean:.3g} s"
        raise broken(source, "time", rule, got, "Write the sampling period in rig.toml: [rig] sample_time = 0.001.")
    return mean, resample, notes


def spans(t: FloatArray, bad: BoolArray) -> list[tuple[float, float]]:
    """Return the first and last instant [s] of every run of true samples.

    Parameters
    ----------
    t, bad
        Time [s] and flags, ndarray, shape (n,).
    """
    edges = np.diff(np.r_[False, bad, False].astype(np.int8))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(float(t[a]), float(t[b])) for a, b in zip(first, last, strict=True)]


def _without_empty(signals: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], list[str]]:
    """Return the signals without those that hold no value and are not needed beside others."""
    full = {name: values for name, values in signals.items() if np.isfinite(values).any()}
    empty = [name for name in signals if name not in full]
    if not empty or "u" in empty or not any(name[0] in "xv" and name != "xr" for name in full):
        return signals, []
    return full, [f"no value of {' and '.join(empty)}: left out"]


def _fill(
    t: FloatArray, signals: dict[str, FloatArray], source: str
) -> tuple[dict[str, FloatArray], dict[str, list[tuple[float, float]]]]:
    """Interpolate missing values and say where."""
    filled: dict[str, FloatArray] = {}
    missing: dict[str, list[tuple[float, float]]] = {}
    for name, values in signals.items():
        good = np.isfinite(values)
        if good.all():
            filled[name] = values
            continue
        share = 1.0 - float(np.mean(good))
        if share > MOST_MISSING:
            raise broken(
                source,
                f"column {name}",
                f"at most {MOST_MISSING:.0%} of the values may be missing",
                f"{share:.0%}",
                "Export the log again, or remove the column.",
            )
        missing[name] = spans(t, ~good)
        filled[name] = _held(t[good], values[good], t) if name == "u" else np.interp(t, t[good], values[good])
    return filled, missing


def _held(t: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Return the latest value at each instant of the grid (zero-order hold)."""
    latest = np.searchsorted(t, grid + 1e-9, side="right") - 1
    return values[np.clip(latest, 0, values.size - 1)]


def _resample(
    t: FloatArray, signals: dict[str, FloatArray], step: float, gaps: BoolArray
) -> tuple[FloatArray, dict[str, FloatArray]]:
    grid = t[0] + step * np.arange(int(np.floor((t[-1] - t[0]) / step + 1e-6)) + 1)
    resampled = {name: np.interp(grid, t, values) for name, values in signals.items()}
    # a command is held from sample to sample, but who knows where in a gap it changed
    before = np.clip(np.searchsorted(t, grid + 1e-9, side="right") - 1, 0, gaps.size - 1)
    inside = gaps[before] & (grid < t[before + 1] - 1e-9)
    resampled["u"] = np.where(inside, resampled["u"], _held(t, signals["u"], grid))
    return grid, resampled


def _without_unknown_commands(
    t: FloatArray, signals: dict[str, FloatArray], Ts: float
) -> tuple[FloatArray, dict[str, FloatArray], list[str]]:
    """Return the longest piece without a gap in which nobody knows what the command did.

    Outputs that are lost are masked, and harm nothing. A command that is wrong moves the model for ever after: what it may have
    done in a gap is held against what it does otherwise.
    """
    good = np.isfinite(signals["u"])
    if not good.any():
        return t, signals, []
    step, u = np.diff(t), _held(t[good], signals["u"][good], t)
    done = np.cumsum(u - np.mean(u)) * Ts
    unknown = (step > LOST * Ts) & (np.abs(np.diff(u)) * (step - Ts) > UNKNOWN * float(np.ptp(done)))
    found = pieces(unknown)
    if len(found) == 1:
        return t, signals, []
    best, told = longest(found)
    where = int(np.argmax(unknown))
    note = f"the command changes in gaps of time, the first {step[where]:.3g} s at {t[where]:.4g} s: {told}"
    return t[best], {name: values[best] for name, values in signals.items()}, [note]
