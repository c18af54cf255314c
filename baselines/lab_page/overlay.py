"""Measured and simulated on one chart, for a range of time."""

from __future__ import annotations

from typing import Literal

import numpy as np

from baselines.lab_page import texts
from baselines.lab_page.chart import Axis, Chart, series
from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import FloatArray

Signal = Literal["v1", "v2", "x1", "x2"]
# points of a line: more than a screen has pixels
_MOST = 1800


def simulated(drive: Drive, recording: Recording, signal: Signal) -> FloatArray | None:
    """Return a signal of the drive under the recorded command, ndarray, shape (n,); ``None`` where the drive has none."""
    t = np.arange(recording.n) * recording.sample_time
    run = drive.simulate(t, recording.u)
    values: FloatArray | None = getattr(run, signal)
    if values is not None and signal[0] == "x":
        measured = getattr(recording, signal)
        values = values + float(measured[0]) if measured is not None else values
    return values


def overlay(
    drive: Drive | None, recording: Recording, signal: Signal, span: tuple[float, float] | None = None
) -> tuple[Chart, float | None]:
    """Return the chart of one signal, measured and simulated, and the rms of their difference in the rig's units.

    Parameters
    ----------
    drive
        ``None``: what was measured alone.
    recording
        As read.
    signal
        Which channel; it must be recorded.
    span
        Range of time [s of the rig]; ``None``: all.

    Raises
    ------
    ValueError
        If the channel was not recorded.
    """
    measured: FloatArray | None = getattr(recording, signal)
    if measured is None:
        have = ", ".join(name for name, _v in recording.channels())
        raise ValueError(
            f"signal: {signal} was not recorded in {recording.name}; there are {have}. Choose one of them."
        )
    units = recording.units
    size = units.one("mm/s" if signal[0] == "v" else "mm")
    t = recording.t / units.one("s")
    low, high = span if span is not None else (float(t[0]), float(t[-1]))
    chosen = np.flatnonzero((t >= low) & (t <= high))
    if len(chosen) < 2:
        chosen = np.arange(recording.n)
    thin = chosen[:: max(1, len(chosen) // _MOST)]
    colour = "x1" if signal[1] == "1" else "x2"
    lines = [series(t[thin], measured[thin] / size, "soft", name=f"{signal} {texts.MEASURED}", width=1.2)]
    rms = None
    model = None if drive is None else simulated(drive, recording, signal)
    if model is not None:
        lines.append(
            series(t[thin], model[thin] / size, "x1" if colour == "x1" else "x2", name=f"{signal} {texts.SIMULATED}")
        )
        good = recording.valid(signal)[chosen]
        difference = (measured - model)[chosen][good] / size
        rms = float(np.sqrt(np.mean(difference**2))) if len(difference) else None
    unit = units.name("mm/s" if signal[0] == "v" else "mm")
    summary = f"{recording.name}, {signal}" + (
        "" if rms is None else f"; {texts.FIT_RMS.format(rms=f'{rms:.3g} {unit}')}"
    )
    shown = (float(t[thin[0]]), float(t[thin[-1]]))
    chart = Chart(
        recording.name, Axis("t [s]", *shown), Axis(f"{signal} [{unit}]"), lines, summary=summary, brush=True
    )  # fmt: skip
    return chart, rms


def signals(recording: Recording) -> list[Signal]:
    """Return which signals were recorded, velocities first where they were measured."""
    have = [name for name, _values in recording.channels()]
    return sorted(have, key=lambda name: (name[0] != "v", name))
