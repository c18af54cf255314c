"""What an encoder counts, as a speed, and what speed a cart can plausibly gain.

Frozen readings and lost counts are judged by the same two numbers: the speed of one count per sample, and
the change of speed that the cart of this run reaches between two samples.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, cast

import numpy as np

if TYPE_CHECKING:
    from flexdrive_gym.recording import BoolArray, FloatArray, Recording

Encoder = Literal["encoder_1", "encoder_2"]

PERCENTILE = 98.0  # of the change of speed while moving: the drive switches for a few percent of every run
ENOUGH = 200  # samples in motion that tell what a cart can do
SMOOTHING = 5  # samples: averages the counts out
LEAST_BLUR = 5.0  # mm/s: about one count per ms, for channels that show no count
FASTEST = 1e4  # mm/s that no cart of a laboratory drive reaches
LONGEST_LEAP = 10  # samples: a velocity filter smears a leap over some
RAREST = 0.01  # share of the samples that leaps may take; a wrong unit takes nearly all in which the cart moves
RESTS = 0.2  # of its rms speed, below which a cart hardly moves; one that swings is so slow a tenth of the time


def channel(recording: Recording, name: str) -> FloatArray | None:
    """Return a channel by name, ndarray, shape (n,), or ``None`` where it was not recorded."""
    return cast("FloatArray | None", getattr(recording, name))


def encoder_speed(recording: Recording, where: Encoder) -> tuple[FloatArray, float] | None:
    """Return what an encoder counted.

    Parameters
    ----------
    recording
        The run.
    where
        The encoder.

    Returns
    -------
    speed : ndarray, shape (n,)
        Raw difference of the position, else the velocity channel [mm/s].
    count : float
        Speed of one count per sample [mm/s]; 0 where no count is known.
    """
    cart = where[-1]
    x, v = channel(recording, f"x{cart}"), channel(recording, f"v{cart}")
    Ts = recording.sample_time
    count = recording.quantum[int(cart) - 1] / Ts
    if x is not None:
        return np.diff(x, prepend=x[0]) / Ts, count
    # a filtered velocity without its position never reads exactly zero; nothing is found in it
    return None if v is None else (v, count)


def leaps(speed: FloatArray) -> list[tuple[int, int]]:
    """Return where the reading leaps, as no cart can: an encoder that hung makes up for its counts at once.

    A leap exceeds :data:`FASTEST`; its neighbours that exceed a quarter of that belong to it, as a filter of the velocity
    leaves them.

    Parameters
    ----------
    speed
        Counted speed [mm/s], ndarray, shape (n,); NaN allowed.

    Returns
    -------
    list of (int, int)
        First and last sample of each.
    """
    size = np.abs(np.nan_to_num(speed))
    edges = np.diff(np.r_[0, (size > 0.25 * FASTEST).astype(np.int8), 0])
    runs = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return [(int(first), int(end) - 1) for first, end in runs if size[first:end].max() > FASTEST]


def plausible_change(speed: FloatArray, still: BoolArray) -> float:
    """Return the change of speed per sample that the cart plausibly reaches.

    Only what happens between standstills counts: at their edges are the jumps that are to be judged, and a
    cart that friction stops has decelerated as hard just before.

    Parameters
    ----------
    speed
        Counted speed [mm/s], ndarray, shape (n,).
    still
        Samples of long standstills, ndarray of bool, shape (n,).

    Returns
    -------
    float
        98th percentile [mm/s]; 0 where the cart hardly moves.
    """
    smooth = np.convolve(speed, np.full(SMOOTHING, 1.0 / SMOOTHING), mode="valid")
    change = np.abs(smooth[SMOOTHING:] - smooth[:-SMOOTHING]) / SMOOTHING
    touched = np.convolve(still, np.ones(2 * SMOOTHING), mode="valid") > 0.5
    if np.sum(~touched) < ENOUGH:  # hardly any motion in between: take what moves at all
        touched = (smooth[SMOOTHING:] == 0.0) & (smooth[:-SMOOTHING] == 0.0)
    moving = change[~touched]
    return float(np.percentile(moving, PERCENTILE)) if moving.size > 4 * SMOOTHING else 0.0


def other_rests(recording: Recording, where: Encoder, first: int, last: int) -> bool:
    """Return whether the other cart mostly rests from sample ``first`` to ``last``, so that friction may hold both.

    Where it is unknown, a drive rests at its start.
    """
    counted = encoder_speed(recording, _other(where))
    if counted is None:
        return first <= 1
    speed = np.abs(counted[0])
    slow = speed[first : last + 1] < RESTS * np.sqrt(np.mean(speed**2))
    return bool(np.mean(slow) > 0.5)


def other_travel(recording: Recording, where: Encoder) -> float:
    """Return the travel of the other cart [mm], 0 where unknown."""
    counted = encoder_speed(recording, _other(where))
    return 0.0 if counted is None else float(np.ptp(np.cumsum(counted[0]))) * recording.sample_time


def _other(where: Encoder) -> Encoder:
    return "encoder_2" if where == "encoder_1" else "encoder_1"
