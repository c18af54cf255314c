r"""Effects along the track whose phase differs from run to run, because recordings begin anywhere.

A ripple :math:`a \sin(2\pi x/P + \varphi_r)` has one amplitude and one period, and in every recording a phase of its own.
With the whitened columns S of sine and cosine, turned and scaled until they do not correlate and have the information h
each, and the residual e of a recording, the likelihood ratio is averaged over the phase,

.. math:: I_0\bigl(a |S^T e|\bigr)\, e^{-a^2 h / 2} ,

and a is estimated from the other recordings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Values, free
from identification.mismatch.noise.friction import dry_level, moving
from identification.replay.output_error import simulate_run

# neighbouring periods differ by half a turn over the way travelled
_TURNS = 0.5
# friction along a track changes over centimetres; what changes faster is a ripple of the drive
_SHORTEST_FRICTION_MM = 25.0
_MOST_PERIODS = 45


@dataclass(frozen=True)
class Phase:
    """A ripple at one place with one period.

    Attributes
    ----------
    id, where
        Of the catalogue.
    period
        [mm].
    """

    id: str
    where: str
    period: float

    @property
    def name(self) -> tuple[str, str]:
        """Effect and place: what a finding is called by."""
        return self.id, self.where


def phases(bench: Bench, values: Values) -> Iterator[tuple[Phase, list[FloatArray]]]:
    """Yield ripples with the change of the rows per unit of sine and cosine, on a grid of periods.

    They follow the simulated motion: a ripple along the measured one would tell the simulation where the carts went.
    """
    ids = {(e.id, w) for e in EFFECTS for w in e.where}
    tracks = [simulate_run(values, replace(free(run), positions=True)) for run in bench.runs]
    for c in range(bench.carts):
        level = dry_level(values, c)
        track = [x[c] for x in tracks]
        # a cart that a fast sine hardly moves tells nothing of the track: the recordings that go far do
        way = float(np.max([np.ptp(x) for x in track]))
        if c == 0 and ("cogging", "drivetrain") in ids:
            yield from _forces(bench, values, "cogging", "drivetrain", c, _periods(4.0, way), track, None)
        if level > 0.0:
            against = [-moving(x, run.sample_time, positions=True) for x, run in zip(track, bench.runs, strict=True)]
            periods = _periods(_SHORTEST_FRICTION_MM, way)
            yield from _forces(bench, values, "position_friction", f"cart_{c + 1}", c, periods, track, against)
        if ("encoder_eccentricity", f"encoder_{c + 1}") in ids:
            for period in _periods(10.0, way):
                columns = [_reading(bench, c, period, track, turn) for turn in (0.0, 0.5 * np.pi)]
                yield Phase("encoder_eccentricity", f"encoder_{c + 1}", period), columns


def _periods(shortest: float, way: float) -> list[float]:
    if way < shortest:
        return []
    grid = np.arange(1.0 / way, 1.0 / shortest, _TURNS / way)
    return [float(1.0 / f) for f in grid[:_MOST_PERIODS]]


def _forces(
    bench: Bench,
    values: Values,
    id_: str,
    where: str,
    c: int,
    periods: list[float],
    track: list[FloatArray],
    against: list[FloatArray] | None,
) -> list[tuple[Phase, list[FloatArray]]]:
    pushes = [partial(_push, c, period, turn, track, against) for period in periods for turn in (0.0, 0.5 * np.pi)]
    size = max(0.05 * dry_level(values, c), 1e-6)
    made = bench.pushed(values, pushes, size) if pushes else []
    return [(Phase(id_, where, p), [made[2 * i], made[2 * i + 1]]) for i, p in enumerate(periods)]


def _push(
    c: int, period: float, turn: float, track: list[FloatArray], against: list[FloatArray] | None, r: int
) -> FloatArray:
    wave = np.sin(2.0 * np.pi * track[r] / period + turn)
    force = np.zeros((2, len(wave)))
    force[c] = wave if against is None else wave * against[r]
    return force


def _reading(bench: Bench, c: int, period: float, track: list[FloatArray], turn: float) -> FloatArray:
    """Return the change of the rows by an error of the reading; a reading begins where its encoder is."""
    change = np.zeros(len(bench.valid))
    for p in bench.pieces:
        if p.cart != c:
            continue
        run = bench.runs[p.recording]
        wave = np.sin(2.0 * np.pi * track[p.recording] / period + turn)
        edges = np.arange(0, len(wave), run.block)
        if run.positions:
            row = np.add.reduceat(wave, edges) / np.diff([*edges, len(wave)])
        else:
            ends = np.append(edges[1:] - 1, len(wave) - 1)
            before = np.concatenate([[wave[0]], wave[ends[:-1]]])
            row = (wave[ends] - before) / (np.diff([*edges, len(wave)]) * run.sample_time)
        change[p.rows] = -row * bench.valid[p.rows]
    return change
