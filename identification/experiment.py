"""What experiment a recording is, from its data alone: what drove it, which carts were held, whether its command is one.

A cart is *held* where it stays behind while the spring pulls at it as much as in runs in which it moves. Two carts that move
freely never do that: slowly driven they move alike, and a fast sine that cart 2 hardly answers deflects the spring
hardly at all.

A column that is called command may be a *reference*: the target of a controller whose command was not recorded. Position
comes to rest where such a column says, in the column's own numbers, or follows it with unit gain and less than an eighth
of a period late; a force on free carts does neither, because velocity answers it and position is a quarter of a period
and more behind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording

Experiment = Literal["square", "sine", "step", "ramp", "p_control", "closed_loop", "free_decay", "other"]

WORDS: Mapping[Experiment, str] = {
    "square": "square wave", "sine": "sine", "step": "steps", "ramp": "ramp", "p_control": "P-control",
    "closed_loop": "closed loop", "free_decay": "free decay", "other": "other excitation",
}  # fmt: skip

# travel that a held cart may have, of the other one's: mounts give way
_STAYS = 0.1
# deflection of the spring at which a free cart would have moved, of the median of runs with both carts moving: friction
# holds a cart
# against less, for a whole run if need be
_PULLED = 0.9
_MOVES = 0.3
# speed back, of that forth, from which on a velocity reverses
_REVERSES = 0.1
# encoder counts that a cart must travel to be seen moving
_COUNTS = 100.0
# a command below this, of the largest in the data set, is none
_SILENT = 1e-6
# share of a step command's samples on plateaus, and how many levels it may have
_ON_PLATEAU, _MOST_CHANGES = 0.9, 12
# rms that straight lines may leave of a ramp, of its rms, and samples over which one changes
_STRAIGHT, _SLOPING = 0.01, 50
# how near to 1 the gain from a reference to the position is, and what it may leave of the position's travel
_UNIT_GAIN, _LEFT = 0.1, 0.12
# seconds that a plateau must last for a position to settle, and the part of it where it must have
_PLATEAU_S, _SETTLED = 0.4, 0.3
_VALID = 0.5


@dataclass(frozen=True)
class Reference:
    """Why a recorded command is taken for a reference.

    Attributes
    ----------
    channel
        Position that follows it.
    gain
        Of that position over the command, in the numbers of the file or of the rig, whichever is nearer to 1.
    """

    channel: Literal["x1", "x2"]
    gain: float


def experiment_of(recording: Recording) -> Experiment:
    """Return the kind of experiment; a zero command is a free decay where anything moves."""
    kind, u = recording.excitation.kind, recording.u
    if kind == "closed_loop":
        return "closed_loop" if recording.excitation.gain is None else "p_control"
    if silent(recording):
        return "free_decay" if any(np.ptp(y) > 0.0 for _, y in recording.channels()) else "other"
    if kind in ("square", "sine"):
        return kind
    if _is_step(u, recording.sample_time):
        return "step"
    return "ramp" if _is_ramp(u) else "other"


def silent(recording: Recording) -> bool:
    """Whether the command is zero throughout."""
    return not bool(np.max(np.abs(recording.u)) > _SILENT)


def _is_step(u: FloatArray, Ts: float) -> bool:
    """Whether the command stands on a few levels."""
    changes = np.flatnonzero(np.diff(u))
    edges = np.r_[0, changes + 1, u.size]
    lengths = np.diff(edges)
    long = lengths * Ts >= 0.5 * _PLATEAU_S
    return bool(np.sum(lengths[long]) >= _ON_PLATEAU * u.size and 1 <= np.sum(long) <= _MOST_CHANGES)


def _is_ramp(u: FloatArray) -> bool:
    """Whether the command is made of a few straight lines: a ramp, or a triangle wave of a few periods.

    The sample farthest from the lines so far is a kink of a command that is made of lines; a sine needs twenty lines a period
    to come as near.
    """
    size = float(np.std(u))
    if size == 0.0 or np.count_nonzero(np.diff(u)) < _SLOPING:
        return False
    samples, knots = np.arange(u.size), [0, u.size - 1]
    while len(knots) <= _MOST_CHANGES + 1:
        left = u - np.interp(samples, knots, u[knots])
        if float(np.sqrt(np.mean(left**2))) < _STRAIGHT * size:
            return True
        knots = sorted({*knots, int(np.argmax(np.abs(left)))})
    return False


def position(recording: Recording, cart: int) -> FloatArray | None:
    """Return where a cart was from its start on [mm], ndarray, shape (n,), or ``None`` where too little of it was seen."""
    x, v = (recording.x1, recording.v1) if cart == 1 else (recording.x2, recording.v2)
    if x is not None and np.mean(recording.valid("x1" if cart == 1 else "x2")) > _VALID:
        return np.asarray(x - x[0])
    if v is not None:
        keep = recording.valid("v1" if cart == 1 else "v2")
        if np.mean(keep) > _VALID:
            return np.asarray(np.cumsum(np.where(keep, v, 0.0)) * recording.sample_time)
    return None


@dataclass(frozen=True)
class _Travel:
    """Travel of both carts and the largest deflection of the spring [mm]."""

    carts: tuple[float, float]
    deflection: float
    least: float

    @property
    def behind(self) -> int:
        """The cart that stayed behind, 0 if both moved or neither."""
        slow = 1 if self.carts[0] < self.carts[1] else 2
        other = self.carts[2 - slow]
        return slow if other > self.least and self.carts[slow - 1] < _STAYS * other else 0

    @property
    def both(self) -> bool:
        return min(self.carts) > max(_MOVES * max(self.carts), self.least)


def held_carts(recordings: Sequence[Recording]) -> tuple[tuple[int, ...], ...]:
    """Return which carts were held in every recording.

    Parameters
    ----------
    recordings
        Of one rig; what a recording says itself (``Recording.held``) holds.

    Returns
    -------
    tuple of tuple of int
        Carts 1 and 2 that were held; of one alone the other moved.
    """
    travels = [_travel(r) for r in recordings]
    moved = [t.deflection for t in travels if t is not None and t.both]
    usual = float(np.median(moved)) if moved else None
    return tuple(r.held or _held(r, t, usual) for r, t in zip(recordings, travels, strict=True))


def _travel(recording: Recording) -> _Travel | None:
    first, second = position(recording, 1), position(recording, 2)
    if first is None or second is None or _without_sign(recording):
        return None
    return _Travel(
        (float(np.ptp(first)), float(np.ptp(second))),
        float(np.max(np.abs(first - second))),
        _COUNTS * max(*recording.quantum, 1e-3),
    )


def _without_sign(recording: Recording) -> bool:
    """Whether one velocity never reverses while the other one does, which is no motion of a drive: it adds up to no position."""
    if recording.x1 is not None or recording.x2 is not None:
        return False
    seen = [v[recording.valid(name)] for name in ("v1", "v2") if (v := getattr(recording, name)) is not None]
    ways = [sorted((float(np.max(v)), float(-np.min(v)))) for v in seen]
    one, other = (back > _REVERSES * forth for back, forth in ways)
    return one != other and all(forth > 0.0 for _, forth in ways)


def _held(recording: Recording, travel: _Travel | None, usual: float | None) -> tuple[int, ...]:
    if travel is None or not travel.behind:
        return ()
    if usual is None:
        # with no run to compare with, only a command that lasts makes a free cart follow
        slow = experiment_of(recording) in ("step", "free_decay") or 0.0 < recording.excitation.frequency < 1.0
        return (travel.behind,) if slow else ()
    return (travel.behind,) if travel.deflection > _PULLED * usual else ()


def as_reference(recording: Recording, factors: Mapping[str, float] | None = None) -> Reference | None:
    """Return why the command of an open-loop recording is a reference, or ``None`` if nothing says so.

    Parameters
    ----------
    factors
        Role (``u``, ``x1``, ``x2``) to how one file unit reads in the rig's unit; default 1.
    """
    if recording.closed_loop or silent(recording) or recording.held:
        return None
    factors = factors or {}
    rig = recording.units.one("V") / recording.units.one("mm")
    channels: tuple[Literal["x1", "x2"], ...] = ("x1", "x2")
    for channel in channels:
        x = getattr(recording, channel)
        slope = None if x is None else _followed(recording.u, x, recording.sample_time)
        if slope is None:
            continue
        # a target is written like the position: in the file's numbers, or in the rig's
        own = slope * rig
        raw = own * factors.get("u", 1.0) / factors.get(channel, 1.0)
        gain = min((own, raw), key=lambda g: abs(g - 1.0))
        if abs(gain - 1.0) < _UNIT_GAIN:
            return Reference(channel, gain)
    return None


def _followed(u: FloatArray, x: FloatArray, Ts: float) -> float | None:
    """Return the slope of a position over the command that it follows, ``None`` where it does not follow."""
    edges = np.r_[0, np.flatnonzero(np.diff(u)) + 1, u.size]
    long = [(a, b) for a, b in pairwise(edges) if (b - a) * Ts >= _PLATEAU_S]
    travel = float(np.ptp(x))
    if travel == 0.0:
        return None
    if sum(b - a for a, b in long) > 0.5 * u.size:
        return _settled(u, x, long, travel)
    return _tracked(u, x, travel)


def _settled(u: FloatArray, x: FloatArray, plateaus: Sequence[tuple[int, int]], travel: float) -> float | None:
    tails = [(int(b - _SETTLED * (b - a)), b) for a, b in plateaus]
    levels = np.array([u[a] for a, _ in tails])
    places = np.array([float(np.mean(x[a:b])) for a, b in tails])
    spread = np.array([float(np.ptp(x[a:b])) for a, b in tails])
    if len(tails) < 2 or np.ptp(levels) < 0.5 * np.ptp(u) or np.max(spread) > _LEFT * travel:
        return None
    slope, offset = np.polyfit(levels, places, 1)
    left = float(np.max(np.abs(places - slope * levels - offset)))
    return float(slope) if left < _LEFT * np.ptp(places) else None


def _tracked(u: FloatArray, x: FloatArray, travel: float) -> float | None:
    spectrum = np.abs(np.fft.rfft(u - u.mean()))
    period = u.size / max(int(np.argmax(spectrum[1:])) + 1, 1)
    best: tuple[float, float] | None = None
    for late in np.unique(np.linspace(0, period / 8.0, 12).astype(int)):
        a, b = u[: u.size - late], x[late:]
        slope, offset = np.polyfit(a, b, 1)
        left = float(np.sqrt(np.mean((b - slope * a - offset) ** 2)))
        if best is None or left < best[0]:
            best = (left, float(slope))
    return best[1] if best is not None and best[0] < 0.5 * _LEFT * travel else None
