"""Signs and sizes that no drive of a laboratory can have.

A motor that drives a drive at rest puts energy into it, so the mean of command times velocity of cart 1 is never
negative, whatever the friction and the springs. Slowly driven, cart 2 goes where cart 1 goes. The command acts on cart 1 alone,
and cart 2 feels only the spring, so exchanged carts obey the equations of motion less well than the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from flexdrive_gym.recording import FloatArray, Recording
from identification.experiment import position, silent
from identification.signals import motions

# correlation of command and velocity, or of both positions, below which a sign is wrong
_AGAINST, _OPPOSED = -0.1, -0.5
# carts of about a kilogram and motors of some volts: ten times the acceleration of gravity is out of reach [mm/s²]
_HARDEST = 1e5
# a laboratory's track [mm]
_TRACK = 2000.0
_SMOOTH_HZ = 20.0
# mean gain of log-likelihood per sample by exchanging the carts, from which on they are; as they should be, rigs have -0.4 to -3
_EXCHANGED = 0.2
# travel of the other cart's from which on a cart moves, and instants of a run that tell
_MOVES, _INSTANTS = 0.1, 2000
# a command that never takes another value than a whole number, and goes this far, is counted [V]
_COUNTED = 24.0


@dataclass(frozen=True)
class Implausible:
    """What cannot be, and what to write into rig.toml."""

    kind: str
    recordings: tuple[str, ...]
    sentence: str


def implausible(recordings: Sequence[Recording]) -> tuple[Implausible, ...]:
    """Return what cannot be in the signs and sizes of recordings of one rig."""
    found: dict[str, list[str]] = {}
    for r in recordings:
        for kind in _kinds(r):
            found.setdefault(kind, []).append(r.name)
    driven = [r for r in recordings if not silent(r)]
    if exchanged := _exchanged([r for r in driven if _open(r)]):
        # whichever way cart 2 goes at a fast sine says nothing of the motor's sign
        found.pop("sign of u", None)
        found["carts"] = exchanged
    # those that can tell: fast ones say nothing of cart 2's sign, and P-control none of the command's
    able = {"sign of u": sum(map(_open, driven)), "sign of x2": sum(_open(r) and _slow(r) for r in driven)}
    return tuple(
        Implausible(kind, tuple(names), f"{_SENTENCES[kind]} ({_listed(names)})")
        for kind, names in found.items()
        # one run of many may be pushed by hand; a wrong sign is in most of them
        if kind not in able or 2 * len(names) > able[kind]
    )


def _open(r: Recording) -> bool:
    return not r.closed_loop and not r.held


def _slow(r: Recording) -> bool:
    return 0.0 < r.excitation.frequency < 1.0


_SENTENCES = {
    "carts": "the command accelerates cart 2, and the spring alone moves cart 1: exchange the columns of x1 and x2 (v1 and "
    "v2) in rig.toml under [columns]",
    "sign of u": "a positive command moves cart 1 backwards, which takes energy out of a motor: write a "
    "negative factor for u, "
    "or for x1 and x2 both, into rig.toml under [units]",
    "sign of x2": "cart 2 moves against cart 1 even when driven slowly: write a negative factor for x2 (v2) into rig.toml "
    "under [units]",
    "counts as mm": "positions are whole numbers: they look like encoder counts read as millimetres; write the "
    "millimetres per "
    'count into rig.toml, such as x1 = { unit = "mm", factor = 0.0044 }',
    "travel": f"a cart travels more than {_TRACK / 1000.0:g} m, which is longer than a laboratory's track: "
    "give x1 and x2 their "
    "unit and factor in rig.toml",
    "acceleration": "a cart accelerates with more than ten times gravity, which no such motor does: give x1 "
    "and x2 (or v1 and "
    "v2) their unit and factor in rig.toml",
    "counts as V": "the command takes whole numbers far above 24 V: it looks like units of a converter; write "
    "the volts of one "
    'into rig.toml, such as u = { unit = "V", factor = 0.00122 }',
}


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def _kinds(r: Recording) -> list[str]:
    found = []
    if not silent(r) and _open(r):
        found += _signs(r)
    if r.units.length == "mm":
        found += _sizes(r)
    whole = bool(np.all(r.u == np.round(r.u)))
    if r.units.command == "V" and whole and np.max(np.abs(r.u)) > _COUNTED:
        found.append("counts as V")
    return found


def _signs(r: Recording) -> list[str]:
    found = []
    first, second = position(r, 1), position(r, 2)
    if first is not None:
        v = np.gradient(_smooth(first, r.sample_time), r.sample_time)
        size = float(np.linalg.norm(v) * np.linalg.norm(r.u))
        if size > 0.0 and float(v @ r.u) < _AGAINST * size:
            found.append("sign of u")
    if first is not None and second is not None:
        slow = [x - np.mean(x) for x in (first, second)]
        size = float(np.linalg.norm(slow[0]) * np.linalg.norm(slow[1]))
        if size > 0.0 and float(slow[0] @ slow[1]) < _OPPOSED * size and _slow(r):
            found.append("sign of x2")
    return found


def _exchanged(recordings: Sequence[Recording]) -> list[str]:
    """Return the recordings that say so if the carts are exchanged, else nothing."""
    gains = {r.name: g for r in recordings if (g := _gain_of_exchange(r)) is not None}
    if not gains or float(np.mean(list(gains.values()))) < _EXCHANGED:
        return []
    return [name for name, gain in gains.items() if gain > 0.0]


def _gain_of_exchange(r: Recording) -> float | None:
    """Return the gain of log-likelihood per sample from a model whose command acts on cart 2; ``None`` if not both move."""
    x = [position(r, 1), position(r, 2)]
    travels = [0.0 if p is None else float(np.ptp(p)) for p in x]
    if not min(travels) > _MOVES * max(travels):
        return None
    h, every = r.sample_time, max(r.n // _INSTANTS, 1)
    x1, x2, u = (_smooth(p, h) for p in (*(p for p in x if p is not None), r.u))
    v1, v2 = np.gradient(x1, h), np.gradient(x2, h)
    signs = [_smooth(np.sign(v), h) for v in (v1, v2)]
    felt = np.column_stack([x1, x2, v1, v2, np.ones(r.n)])

    def unexplained(v: FloatArray, *columns: FloatArray) -> float:
        A = np.column_stack([felt, *columns])[::every]
        A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        a = np.gradient(v, h)[::every]
        left = a - A @ np.linalg.lstsq(A, a, rcond=None)[0]
        return float(np.log(max(float(left @ left) / max(float(a @ a), 1e-300), 1e-12)))

    as_read = unexplained(v1, u, signs[0]) + unexplained(v2, signs[1])
    return as_read - unexplained(v2, u, signs[1]) - unexplained(v1, signs[0])


def _sizes(r: Recording) -> list[str]:
    places = [x for x in (position(r, 1), position(r, 2)) if x is not None]
    if not places:
        return []
    found = []
    travel = max(float(np.ptp(x)) for x in places)
    if any(x is not None and np.ptp(x) > 20.0 and np.all(x == np.round(x)) for x in (r.x1, r.x2)):
        found.append("counts as mm")
    if travel > _TRACK:
        found.append("travel")
    if any(_hardest(v[keep], r.sample_time) > _HARDEST for v, keep in zip(*motions(r), strict=True)):
        found.append("acceleration")
    return found


def _smooth(values: FloatArray, Ts: float) -> FloatArray:
    if len(values) < 30:
        return values
    return np.asarray(sosfiltfilt(butter(2, min(_SMOOTH_HZ, 0.2 / Ts), fs=1.0 / Ts, output="sos"), values))


def _hardest(v: FloatArray, Ts: float) -> float:
    """Return an acceleration that a thousandth of the samples exceed [mm/s²]."""
    if len(v) < 30:
        return 0.0
    return float(np.quantile(np.abs(np.gradient(_smooth(v, Ts), Ts)), 0.999))
