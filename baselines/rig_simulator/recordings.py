"""One data set: which runs, what the encoders report of them, and the files."""

from __future__ import annotations

import gzip
import os
import tempfile
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from baselines.rig_simulator.faults import broken, place_faults
from baselines.rig_simulator.ingredients import along_the_track, over_time, rig_values
from baselines.rig_simulator.kernel import COUNT_MM, SAMPLE_S, FloatArray
from baselines.rig_simulator.nuisance import nuisance_of_run, track_of
from baselines.rig_simulator.rig import p_law, run
from baselines.rig_simulator.truth import Truth

FREQUENCIES_HZ = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 8.0, 12.0, 16.0, 20.0)
SINE_V = 2.5
OPEN_LOOP_S = 8.0
CLOSED_LOOP_S = 4.0
GAIN = 0.05
STROKE_MM, MOVE_S, DWELL_S = 50.0, 0.72, 0.28


@dataclass(frozen=True)
class Experiment:
    """One run of the handout's 2.1, 2.5 or 2.6: its file's name, kind, amplitude [V], frequency [Hz]."""

    name: str
    kind: str
    amplitude: float = 0.0
    frequency: float = 0.5


@dataclass(frozen=True, eq=False)
class Log:
    """What the rig writes down of one run: command [V] and counts, shape (2, n); xr [mm] under P-control.

    ``shown`` is what the encoders showed before counting [mm], shape (2, n); it is written nowhere.
    """

    experiment: Experiment
    u: FloatArray
    counts: FloatArray
    shown: FloatArray
    xr: FloatArray | None = None


def experiments() -> tuple[Experiment, ...]:
    """Return the experiments in their order: P-control, squares, sines, and the squares again at the end."""

    def squares(replicate: str) -> tuple[Experiment, ...]:
        return tuple(Experiment(f"square_{a:.1f}V_0.5Hz_{replicate}", "square", a) for a in (1.5, 2.0))

    sines = tuple(Experiment(f"sine_{SINE_V:.1f}V_{f:.1f}Hz", "sine", SINE_V, f) for f in FREQUENCIES_HZ)
    return (Experiment(f"pctrl_x2_kp{GAIN:.4f}", "p_control"), *squares("a"), *sines, *squares("b"))


def trajectory(t: FloatArray) -> FloatArray:
    """Return the handout's reference [mm]: 50 mm forth and back with dwells, two such moves in 4 s, as cycloids."""
    phase = np.mod(t, 2.0 * (MOVE_S + DWELL_S))
    forth = np.clip(phase / MOVE_S, 0.0, 1.0)
    back = np.clip((phase - MOVE_S - DWELL_S) / MOVE_S, 0.0, 1.0)

    def move(s: FloatArray) -> FloatArray:
        return np.asarray(s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))

    return STROKE_MM * (move(forth) - move(back))


def command(experiment: Experiment) -> FloatArray:
    """Return u [V], or xr [mm] of the P-control run, at every sample."""
    seconds = CLOSED_LOOP_S if experiment.kind == "p_control" else OPEN_LOOP_S
    t: FloatArray = np.arange(round(seconds / SAMPLE_S) + 1, dtype=np.float64) * SAMPLE_S
    if experiment.kind == "p_control":
        return trajectory(t)
    cycles = t * experiment.frequency
    if experiment.kind == "square":
        return np.where(np.mod(cycles + 1e-9, 1.0) < 0.5, experiment.amplitude, -experiment.amplitude)
    return np.asarray(experiment.amplitude * np.sin(2.0 * np.pi * cycles))


def simulate_data_set(truth: Truth, only: Collection[str] | None = None) -> Iterator[Log]:
    """Yield the runs of a data set one by one, before any encoder fault; all of them, or ``only`` those of these names."""
    values = rig_values(truth)
    bare = track_of(truth.nuisance, np.random.default_rng([truth.seed, 3]))
    track = along_the_track(bare, truth.effects)
    band = min(values["d1"], values["d2"]) / values["k"]
    for order, experiment in enumerate(experiments()):
        if only is not None and experiment.name not in only:
            continue
        asked = command(experiment)
        # each run has its own stream, so that an effect never changes the nuisance of the next run
        rng = np.random.default_rng([truth.seed, 4, order])
        world = nuisance_of_run(truth.nuisance, track, len(asked), band, rng)
        world = over_time(world, truth, order, np.random.default_rng([truth.seed, 5, order]))
        closed = experiment.kind == "p_control"
        motion = run(values, world, asked, controller=p_law(GAIN) if closed else None)
        yield Log(experiment, motion.u, motion.counts, motion.shown, asked if closed else None)


def velocities(counts: FloatArray) -> FloatArray:
    """Return the raw backward difference of counts [mm/s], 0 at the first sample, ndarray, shape (2, n)."""
    return np.diff(counts, axis=1, prepend=counts[:, :1]) * COUNT_MM / SAMPLE_S


def data_set(truth: Truth) -> tuple[Truth, tuple[Log, ...]]:
    """Make a data set; return the truth with its faults placed, and the logs with them inside."""
    logs = tuple(simulate_data_set(truth))
    speeds = {log.experiment.name: velocities(log.counts) for log in logs if log.xr is None}
    faults = place_faults(speeds, truth.n_faults, np.random.default_rng([truth.seed, 6]))
    rng = np.random.default_rng([truth.seed, 7])
    whole = []
    for log in logs:
        counts = log.counts.copy()
        for fault in faults:
            if fault.recording == log.experiment.name:
                counts = broken(counts, fault, rng)
        whole.append(replace(log, counts=counts))
    return replace(truth, faults=faults), tuple(whole)


def as_text(log: Log, rectified: tuple[bool, bool] = (False, False)) -> str:
    """Return a log as csv.

    A rectified sensor counts pulses without their sign. It feeds the velocity display only: P-control needs a sign, and
    its positions come from the quadrature counter.
    """
    t = np.arange(len(log.u)) * SAMPLE_S
    if log.xr is not None:
        x = log.counts * COUNT_MM
        head, line = "t_s,u_V,xr_mm,x1_mm,x2_mm", "%.3f,%.6g,%.5f,%.4f,%.4f"
        columns = [t, log.u, log.xr, x[0], x[1]]
    else:
        v = velocities(log.counts)
        head, line = "t_s,u_V,v1_mm_s,v2_mm_s", "%.3f,%.6g,%.4f,%.4f"
        columns = [t, log.u, *(np.abs(v[i]) if rectified[i] else v[i] for i in range(2))]
    # adding zero makes a negative zero positive
    rows = [line % row for row in zip(*((column + 0.0).tolist() for column in columns), strict=True)]
    return "\n".join([head, *rows]) + "\n"


def write_data_set(truth: Truth, logs: tuple[Log, ...], folder: Path) -> None:
    """Write the recordings of a data set, and nothing else, into a folder."""
    rectified = tuple(
        any(e.id == "rectified_sensor" and e.where == w for e in truth.effects) for w in ("encoder_1", "encoder_2")
    )
    for log in logs:
        # no time of making inside, so that a data set made again is the same to the last bit
        data = gzip.compress(as_text(log, (rectified[0], rectified[1])).encode(), 6, mtime=0)
        put(folder / f"{log.experiment.name}.csv.gz", data)


def put(path: Path, data: bytes) -> None:
    """Write a file whole or not at all; by the standard library alone, as the generator stands on nothing else here."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
