"""Measured and simulated on one chart, for a range of time."""

from __future__ import annotations

from typing import Literal

import numpy as np

from baselines.lab_page import texts
from baselines.lab_page.chart import Axis, Chart, Colour, series
from flexdrive_gym import Drive, Recording
from flexdrive_gym.recording import FloatArray
from identification.validation import simulate_recording

Signal = Literal["v1", "v2", "x1", "x2"]
# points of a line: more than a screen has pixels
_MOST = 1800


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
    colour: Colour = "x1" if signal[1] == "1" else "x2"
    lines = [series(t[thin], measured[thin] / size, "soft", name=f"{signal} {texts.MEASURED}", width=1.2)]
    rms, how = None, ""
    model: FloatArray | None = None
    if drive is not None:
        run, how = simulate_recording(drive, recording)
        model = getattr(run, signal)
    if model is not None:
        lines.append(series(t[thin], model[thin] / size, colour, name=f"{signal} {texts.SIMULATED}, {how}"))
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
