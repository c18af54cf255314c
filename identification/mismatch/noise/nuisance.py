r"""Run-to-run variability: what differs between recordings of any rig, and is nobody's missing physics.

On cart c it is a force

.. math:: -\operatorname{sgn}(v_c)\, d_c \Bigl(l + \sum_k w_k \Lambda_k(t) + \sum_j r_j \sin(2\pi x_c/\lambda_j + \varphi_j)\Bigr)
   - g\, b_c v_c + \sum_j h_j \sin(2\pi x_c/\lambda_j + \varphi_j) ,

with the dry friction :math:`d_c(t)` of the drive along the measured motion, which a load or a place may change; a friction
level l, hat functions :math:`\Lambda_k` every two seconds, wavelengths half an octave apart and viscous friction g; the
deflection in which the spring starts; the time between command and reading, which is
known to a sample at best; and the hysteresis of an encoder, a fraction of a count.
Amplitudes are random effects of every recording. The prior standard deviations of forces that dry friction scales
were measured on ``mte360_2022`` and ``mte360_2025`` (replicates of the same command, ``python -m benchmarks blind_nuisance``),
relative to the rig's own dry friction, so that they carry over to rigs of other scales: roughness to that of its cart,
for it is friction, hills to that of both carts, for they pull at a cart that rolls easily, too. A constant force has no
direction of its own: to a run that moves by less than a wave a hill is one, the same hill for all that begin nearby. That of
viscous friction, half of dry friction's, and the hysteresis are assumptions. Each cart has scales of its own, and the spectrum of
its track is estimated in four bands: how long the waves of a track are differs from track to track. That of an axis which is
measured by its angle repeats with every turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.noise.friction import dry_level, level_along, moving, speed

# relative to dry friction: between runs, within a run, along the track; and forces along the track
LEVEL, WANDER, ROUGH, HILLS = 0.06, 0.04, 0.026, 0.011
# viscous friction between runs, relative to itself; not measured, its scale is estimated
VISCOUS = 0.03
# a spring starts anywhere within the friction of the easier cart: uniform, ±0.7 of it
START = 0.4
# command and readings fall anywhere within a sample: uniform, [samples]
INSTANT = 0.29
# an encoder's own hysteresis: its reading reverses a little after the cart, [counts]; not measured, and not estimated: what all
# recordings share would shrink it
HYSTERESIS = 0.05
WAVES_MM: dict[str, tuple[float, ...]] = {
    "short": (4.0, 6.0, 9.0),
    "medium": (13.5, 20.0, 30.0),
    "long": (45.0, 68.0, 100.0),
    "very long": (150.0, 225.0, 340.0),
}
# of an axis that is measured by its angle: its track repeats with every turn, and so many waves fill one
ORDERS = {"short": (30, 20, 14), "medium": (9, 6), "long": (4, 3), "very long": (2, 1)}
KNOT_S = 2.0
# spread of the places where recordings begin; on an axis that turns they begin anywhere
PLACE_MM = 25.0
PLACE_TURNS = 0.5


@dataclass(frozen=True, eq=False)
class Direction:
    """One way in which a recording may differ.

    Attributes
    ----------
    group
        Directions of one group have one standard deviation, relative to their prior one.
    size
        Prior standard deviation of the amplitude.
    change : ndarray, shape (N,)
        Change of the rows per unit amplitude.
    wave
        For a ripple along the track: what it is (cart and kind of force), its wavelength [mm], and whether it is the sine (0) or
        the cosine (1). The track is the same in all recordings, which begin anywhere on it.
    force
        From a recording's number to the force on each cart per unit amplitude, ndarray, shape (2, n); ``None`` where it
        is no force.
    place
        For a ripple: standard deviation of where recordings begin along the track [mm].
    least, most
        Between which factors of the prior one the standard deviation may lie: other rigs are quieter or rougher, but no clock is
        off by more than its sample, and no model of a reversal is more exact than a fraction of a count.
    """

    group: str
    size: float
    change: FloatArray
    wave: tuple[str, float, int] | None = None
    force: Callable[[int], FloatArray] | None = None
    place: float = PLACE_MM
    least: float = 0.25
    most: float = 4.0


class Push(NamedTuple):
    """A force that differs between recordings: a :class:`Direction` before its rows are simulated."""

    group: str
    size: float
    force: Callable[[int], FloatArray]
    wave: tuple[str, float, int] | None = None


def friction_of(c: int) -> str:
    """Return the group of a cart's friction that is a run's own."""
    return f"friction of cart {c + 1}"


def waves(units: Units) -> dict[str, tuple[float, ...]]:
    """Return the wavelengths of a track by band, in the engine's mm."""
    turn = units.revolution
    return WAVES_MM if turn is None else {band: tuple(turn / n for n in orders) for band, orders in ORDERS.items()}


def directions(bench: Bench, values: Values) -> list[Direction]:
    """Return how the rows of a drive change with everything that differs from run to run."""
    levels = [dry_level(values, c) for c in range(bench.carts)]
    typical = float(np.mean(levels))
    used = [c for c in range(bench.carts) if typical > 0.0 and any(run.keep[c].any() for run in bench.runs)]
    made = [push for c in used for push in _on_cart(bench, values, c, typical)]
    changes = bench.pushed(values, [push.force for push in made], max(0.05 * max(levels), 1e-6)) if made else []
    turn = bench.recordings[0].units.revolution
    place = PLACE_MM if turn is None else PLACE_TURNS * turn
    found = [
        Direction(p.group, p.size, change, p.wave, p.force, place) for p, change in zip(made, changes, strict=True)
    ]
    if bench.carts == 2 and values.get("m2", 0.0) < 1e6 and values.get("k", 0.0) > 0.0:
        band = min(dry_level(values, 0), dry_level(values, 1)) / values["k"]
        band = max(band, *(max(run.counts, default=0.0) for run in bench.runs))
        found.append(Direction("start deflection", START * band, bench.displaced(values, max(0.5 * band, 1e-6))))
    found.append(Direction("sampling instant", INSTANT, _later(bench, values), most=1.0))
    return [*found, *_of_readings(bench, values)]


def _on_cart(bench: Bench, values: Values, c: int, typical: float) -> list[Push]:
    """Return the forces on one cart; ``typical`` is the mean dry friction of all carts [V]."""
    cart, own, b = f"of cart {c + 1}", dry_level(values, c), values.get(f"b{c + 1}", 0.0)
    ones = [np.full(len(run.u), typical) for run in bench.runs]
    made: list[Push] = []
    along = [(f"hills {cart}", HILLS, ones)]
    if b > 0.0:
        drag = [-b * speed(run.measured[c], run.sample_time, positions=run.positions) for run in bench.runs]
        made.append(Push(f"viscous friction {cart}", VISCOUS, partial(_shaped, c, drag, None)))
    if own > 0.0:
        against = [
            -level_along(values, run, c) * moving(run.measured[c], run.sample_time, positions=run.positions)
            for run in bench.runs
        ]
        made.append(Push(friction_of(c), LEVEL, partial(_shaped, c, against, None)))
        longest = max(len(run.u) * run.sample_time for run in bench.runs)
        hats = (partial(_hat, bench, k * KNOT_S) for k in range(int(np.ceil(longest / KNOT_S)) + 1))
        made += [Push(f"wander {cart}", WANDER, partial(_shaped, c, against, hat)) for hat in hats]
        along.append((f"rough track {cart}", ROUGH, against))
    for kind, size, level in along:
        for band, lengths in waves(bench.recordings[0].units).items():
            for length in lengths:
                for turn in (0, 1):
                    wave = partial(_wave, bench, c, length, 0.5 * np.pi * turn)
                    force = partial(_shaped, c, level, wave)
                    made.append(Push(f"{kind}, {band}", size, force, (kind, length, turn)))
    return made


def _of_readings(bench: Bench, values: Values) -> list[Direction]:
    """Return by what the readings of encoders differ."""
    found = []
    for c in range(bench.carts):
        quantum = max(run.counts[c] if len(run.counts) > c else 0.0 for run in bench.runs)
        if quantum <= 0.0:
            continue
        g, key = HYSTERESIS * quantum, f"encoder_play.encoder_{c + 1}.g"
        change = bench.residual({**values, key: values.get(key, 0.0) + g}) - bench.residual(values)
        found.append(Direction(f"hysteresis of encoder {c + 1}", g, change / g, least=1.0, most=1.0))
        # a count is a staircase: where a recording is compared by position, its zero lies anywhere within one
        zero = np.zeros(len(bench.valid))
        for p in bench.pieces:
            if p.cart == c and bench.runs[p.recording].positions:
                zero[p.rows] = bench.valid[p.rows]
        if zero.any():
            found.append(Direction("zero", quantum, zero))
    return found


def _later(bench: Bench, values: Values) -> FloatArray:
    """Return how the rows change where a recording's command comes a sample later, shape (N,)."""
    least = min(run.sample_time for run in bench.runs)
    delayed = {**values, "input_delay.tau": values.get("input_delay.tau", 0.0) + least}
    change = bench.residual(delayed) - bench.residual(values)
    for rows, run in zip(bench.rows, bench.runs, strict=True):
        change[rows] *= run.sample_time / least
    return change


def drawn(
    found: Sequence[Direction], scale: Mapping[str, float], recordings: int, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Return random amplitudes of every direction, shape (draws, recordings, directions).

    A ripple has one amplitude and phase for the track; every recording meets it from another place.
    """
    amplitude = rng.standard_normal((draws, recordings, len(found)))
    place = rng.standard_normal((draws, recordings))
    index = {d.wave: i for i, d in enumerate(found) if d.wave is not None}
    for (kind, length, turn), i in index.items():
        if turn == 0:
            j = index[kind, length, 1]
            track = rng.standard_normal((draws, 2))
            angle = 2.0 * np.pi * (found[i].place * place) / length
            amplitude[:, :, i] = track[:, :1] * np.cos(angle) - track[:, 1:] * np.sin(angle)
            amplitude[:, :, j] = track[:, :1] * np.sin(angle) + track[:, 1:] * np.cos(angle)
    return np.asarray(amplitude * np.array([d.size * scale.get(d.group, 1.0) for d in found]))


def _shaped(c: int, level: list[FloatArray], shape: Callable[[int], FloatArray] | None, r: int) -> FloatArray:
    force = np.zeros((2, len(level[r])))
    force[c] = level[r] if shape is None else level[r] * shape(r)
    return force


def _hat(bench: Bench, at: float, r: int) -> FloatArray:
    t = np.arange(len(bench.runs[r].u)) * bench.runs[r].sample_time
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(t - at) / KNOT_S))


def _wave(bench: Bench, c: int, length: float, turn: float, r: int) -> FloatArray:
    return np.asarray(np.sin(2.0 * np.pi * bench.runs[r].track[c] / length + turn))
