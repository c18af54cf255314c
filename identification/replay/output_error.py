r"""Residuals of the output-error model: simulate every recording, compare velocities (or positions, where asked).

The model is the drive's own compiled step, driven by the recorded command, read through the recording's own velocity
processing; residuals are v_measured - v_simulated [mm/s] at the samples no fault touches. Encoder counts are noise of
the measurement, not of the model, so the model is simulated without quantisation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import resample_poly

from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.effects import WORKSPACE
from flexdrive_gym.drive.sample import WORK_SPACE
from flexdrive_gym.recording import BoolArray, FloatArray, Recording
from identification.floor import period_samples, run_variance
from identification.signals import motions

BLOCK_S = 0.005
# longest step of a simulation [s]: against steps of 0.1 ms the lab's velocities differ by 2e-4 mm/s rms at most, by 1e-3 where a
# coupling has play
PHYSICS_S = 2e-3
# how finely a command is told between samples, where it was not held [s]
_FINE_S = 1e-3
# a drive that shows more than this has run away [mm, mm/s]
RUNAWAY = 1e9
# what tells the speed at the start of a run whose velocity was not recorded [s], and how few samples of it are all used
_HEAD_S, _FEW = 0.02, 6


@dataclass(frozen=True, eq=False)
class Run:
    """One recording, prepared for many simulations.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Command [V].
    measured : list of ndarray, shape (n,)
        Velocity per cart [mm/s], or position [mm].
    keep : list of ndarray of bool, shape (n,)
        Valid samples per cart.
    cutoff
        Of the velocity filter [Hz]; 0 for the raw difference, ``None`` where that is for the drive to say.
    track : ndarray, shape (2, n)
        Where the carts were [mm]: positions as recorded, or summed velocities; effects of position follow it.
    floor
        Per cart, variance of block sums that no model can explain [(mm/s)²]: what differs between the periods of the
        run, or the encoder's noise where nothing repeats.
    counts
        Encoder quantum per cart [mm]; empty where none is known.
    positions
        Whether positions are compared instead of velocities.
    fine
        The command between the samples, ndarray, shape (pieces per sample · n,), where it was continuous; ``None`` where it was
        held. Holding such a command would delay it by half a sample and weaken what is fast.
    block_s
        Length of a block of a fit [s]: 5 ms keep every mode of such a drive and average encoder counts.
    """

    name: str
    u: FloatArray
    sample_time: float
    measured: list[FloatArray]
    keep: list[BoolArray]
    start: FloatArray
    cutoff: float | None
    floor: list[float]
    track: FloatArray
    counts: tuple[float, ...] = ()
    positions: bool = False
    fine: FloatArray | None = None
    block_s: float = BLOCK_S

    @property
    def block(self) -> int:
        """Samples per block of a fit."""
        return max(1, round(self.block_s / self.sample_time))

    def blocks(self, cart: int, values: FloatArray) -> FloatArray:
        """Return block sums over valid samples divided by the root of their number, shape (n blocks,).

        For white residuals every entry has the variance of one sample, so sums of squares stay comparable.
        """
        n, b = len(self.u), self.block
        edges = np.arange(0, n, b)
        count = np.add.reduceat(self.keep[cart].astype(np.float64), edges)
        total = np.add.reduceat(np.where(self.keep[cart], values, 0.0), edges)
        return np.asarray(total[count > 0.0] / np.sqrt(count[count > 0.0]))

    def block_times(self, cart: int) -> FloatArray:
        """Return the start time of every block that :meth:`blocks` returns [s]."""
        edges = np.arange(0, len(self.u), self.block)
        count = np.add.reduceat(self.keep[cart].astype(np.float64), edges)
        return np.asarray(edges[count > 0.0] * self.sample_time)


def prepare(recording: Recording) -> Run:
    """Return a recording ready for simulation: velocities, valid samples and the state it starts in."""
    v, keep = motions(recording)
    start = np.zeros(4)
    head = max(3, round(0.01 / recording.sample_time))
    for i, x in enumerate(v):
        # a run that starts at rest shows at most a count; anything more is motion it started with
        place = (recording.x1, recording.x2)[i]
        derived = (recording.v1, recording.v2)[i] is None and place is not None
        speed = _speed(place, recording.sample_time) if derived and place is not None else float(np.mean(x[:head]))
        start[2 * i + 1] = speed if abs(speed) > 2.0 * max(recording.quantum) / recording.sample_time / head else 0.0
        if start[2 * i + 1] != 0.0 and derived:
            # a difference needs the sample before
            keep[i] = keep[i] & (np.arange(recording.n) > 0)
        # encoders start anywhere, but not in the middle of a run; and a single one may be held by a spring to the ground
        if place is not None and (recording.t[0] > 0.0 or len(v) == 1):
            start[2 * i] = place[0]
    u = np.ascontiguousarray(recording.u, dtype=np.float64)
    h = recording.sample_time
    width = max(1, round(BLOCK_S / h))
    floor = []
    for i, x in enumerate(v):
        # a raw difference of counts errs by one count over a whole block, however long
        counts = (recording.quantum[i] / h) ** 2 / 6.0 / width
        repeated = run_variance(x, keep[i], period_samples(recording), width)
        floor.append(max(counts, repeated if np.isfinite(repeated) else 0.0))
    fine = _between(u, max(1, round(h / _FINE_S))) if recording.hold == "band_limited" else None
    track = _track(recording, v, keep)
    quanta: tuple[float, ...] = recording.quantum[: len(v)]
    return Run(recording.name, u, h, v, keep, start, recording.velocity_cutoff, floor, track, quanta, fine=fine)


def _speed(x: FloatArray, h: float) -> float:
    """Return the speed at the first sample: the slope of a parabola through 20 ms, or of what passes through five samples."""
    n = min(max(5, round(_HEAD_S / h)), len(x))
    degree = 2 if n > _FEW else n - 1
    return float(np.polynomial.polynomial.polyfit(np.arange(n), x[:n], degree)[1] / h)


def _between(u: FloatArray, pieces: int) -> FloatArray:
    """Return a band-limited signal in the middle of each of so many pieces of every sample."""
    return np.ascontiguousarray(resample_poly(u, 2 * pieces, 1, padtype="line")[1::2])


def prepare_measured(recording: Recording) -> Run:
    """Return a recording ready for simulation as it was measured: positions where only positions were recorded.

    An error of a position lasts until another makes up for it, so it says little on where it was made; but whoever wants
    positions predicted must fit positions.
    """
    run = prepare(recording)
    places = [x for x in (recording.x1, recording.x2) if x is not None]
    if recording.v1 is not None or recording.v2 is not None or len(places) != len(run.measured):
        return run
    # an encoder count is uniform noise
    floor = [q**2 / 12.0 for q in recording.quantum[: len(places)]]
    return replace(run, measured=places, floor=floor, positions=True)


def _track(recording: Recording, v: Sequence[FloatArray], keep: Sequence[BoolArray]) -> FloatArray:
    """Where the carts were [mm]; while an encoder is faulty, its cart is taken to move as the other one."""
    rows = []
    for c, x in enumerate((recording.x1, recording.x2)[: len(v)]):
        if x is not None and keep[c].all():
            rows.append(x)
            continue
        other = v[1 - c] if len(v) == 2 else np.zeros_like(v[c])
        rows.append((0.0 if x is None else x[0]) + np.cumsum(np.where(keep[c], v[c], other)) * recording.sample_time)
    return np.ascontiguousarray(np.vstack([rows[0], rows[-1]]), dtype=np.float64)


def held(run: Run) -> tuple[FloatArray, FloatArray, int]:
    """Return the command as it is held, shape (pieces · n,), the track at the same instants, and pieces per sample."""
    if run.fine is None:
        return run.u, run.track, 1
    pieces = len(run.fine) // len(run.u)
    return run.fine, np.repeat(run.track, pieces, axis=1), pieces


_QUANTA = [parameters.index(f"encoder_quantisation.{place}.quantum") for place in ("encoder_1", "encoder_2")]
_CUTOFFS = [parameters.index(f"velocity_processing.{place}.cutoff") for place in ("encoder_1", "encoder_2")]


def drive_vector(values: Mapping[str, float], run: Run) -> FloatArray:
    """Return the parameter vector of the step for a run: without encoder counts, with the run's own velocity filter."""
    p = parameters.vector(values)
    p[_QUANTA] = 0.0
    if run.cutoff is not None:
        p[_CUTOFFS] = run.cutoff
    return p


def simulate_run(
    values: Mapping[str, float], run: Run, physics_step: float = PHYSICS_S, pushes: FloatArray | None = None
) -> list[FloatArray]:
    """Return the simulated velocities (or positions) of one run, a list of ndarray of shape (n,) per cart [mm/s].

    ``pushes``, ndarray, shape (2, n), are additional forces on the carts [V].
    """
    u, track, pieces = held(run)
    if pieces > 1:
        pushes = None if pushes is None else np.repeat(pushes, pieces, axis=1)
    readings = np.empty((4, len(u)))
    h = run.sample_time / pieces
    kernels.run_open_loop(
        u,
        h,
        parameters.substeps(values, h, physics_step),
        run.start,
        np.zeros(WORK_SPACE),
        parameters.workspace(values) if pushes is None else np.zeros(WORKSPACE),
        drive_vector(values, run),
        readings,
        None,
        track,
        pushes,
    )
    if not (readings.max() < RUNAWAY and readings.min() > -RUNAWAY):
        # masses so small that the step is unstable for them: a fit that tries them must see a number
        readings = np.clip(np.nan_to_num(readings, nan=RUNAWAY), -RUNAWAY, RUNAWAY)
    if pieces > 1:
        readings = readings[:, ::pieces]
        readings[2:, 1:] = np.diff(readings[:2]) / run.sample_time
    return [readings[i if run.positions else 2 + i] for i in range(len(run.measured))]


def residuals(values: Mapping[str, float], runs: Sequence[Run], pool: Executor | None = None) -> list[FloatArray]:
    """Return measured minus simulated velocity of every run and cart, all samples.

    Parameters
    ----------
    values
        Parameters of the drive.
    runs
        Prepared recordings.
    pool
        Runs the recordings on its threads; the kernels release the interpreter.

    Returns
    -------
    list of ndarray
        In the order run 1 cart 1, run 1 cart 2, run 2 cart 1, ... [mm/s]
    """

    def one(run: Run) -> list[FloatArray]:
        return [m - s for m, s in zip(run.measured, simulate_run(values, run), strict=True)]

    parts = map(one, runs) if pool is None else pool.map(one, runs)
    return [r for part in parts for r in part]


def block_residuals(values: Mapping[str, float], runs: Sequence[Run], pool: Executor | None = None) -> list[FloatArray]:
    """Return :func:`residuals` in blocks of 5 ms over valid samples, as a fit uses them."""

    def one(run: Run) -> list[FloatArray]:
        simulated = simulate_run(values, run)
        return [run.blocks(c, m - s) for c, (m, s) in enumerate(zip(run.measured, simulated, strict=True))]

    parts = map(one, runs) if pool is None else pool.map(one, runs)
    return [r for part in parts for r in part]
