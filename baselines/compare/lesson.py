"""What Lab 3 asks, as runs to look at: P-control stable, critical and unstable, collocated, then Lab 4 and a learnt policy."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np

from baselines.compare.behaviour import SIGNALS, Parts, error_parts
from baselines.compare.comparison import instants
from baselines.compare.results import Comparison
from baselines.controllers import design
from baselines.controllers.p_control import proportional
from baselines.evaluation.metrics import Measures, dwells, measure
from baselines.evaluation.rollout import RIG_TIME_S, run_many
from baselines.lab.experiments import stability_experiments
from baselines.loop_analysis.empirical_margins import EmpiricalMargins, NoMarginsError, empirical_margins
from baselines.loop_analysis.margins import Margins, margins
from baselines.loop_analysis.stability_limit import StabilityLimit, stability_limit
from flexdrive_gym import Controller, Drive, LinearController, Recording
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.references import handout_trajectory
from flexdrive_gym.units import measured_in

_P_TITLES = {"2.1": "stable", "2.2": "critical", "2.3": "unstable", "2.4": "collocated"}


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One controller on the handout's trajectory.

    Attributes
    ----------
    name
        Short, for a column.
    law
        In words.
    reads
        Which encoder.
    period
        How often it acts [s].
    run : ndarray, shape (5, n)
        True x1, v1, x2, v2 and u.
    vibration
        Largest swing of x2 in the second half of a dwell, peak to peak [mm].
    on_rig
        Margins by trial, simulated with friction, counts and limit; ``None`` where the loop fails as it is.
    margins
        Of the sampled linear loop; ``None`` for a black box.
    swing
        Of the cart that swings most in the last six of twelve seconds after one move, peak to peak [mm].
    """

    name: str
    law: str
    reads: str
    period: float = field(metadata=measured_in("s"))
    run: FloatArray = field(metadata=measured_in(SIGNALS))
    measures: Measures
    parts: Parts
    vibration: float = field(metadata=measured_in("mm"))
    on_rig: EmpiricalMargins | None
    margins: Margins | None
    swing: float = field(metadata=measured_in("mm"))


@dataclass(frozen=True, eq=False)
class Lesson:
    """All demonstrations on one drive.

    Attributes
    ----------
    recordings
        The P-control runs as the laboratory records them, by section of the handout.
    limit
        Of P-control from x2.
    shown
        In the order of the handout; the learnt policy last, where there is one.
    learnt
        Name of the learnt group that the last one stands for, and of how many seeds; empty, 0 without.
    """

    drive: Drive
    t: FloatArray = field(metadata=measured_in("s"))
    xr: FloatArray = field(metadata=measured_in("mm"))
    recordings: dict[str, Recording]
    limit: StabilityLimit
    shown: tuple[Demonstration, ...]
    learnt: str = ""
    seeds: int = 0

    def find(self, name: str) -> Demonstration | None:
        """Return a demonstration by its name."""
        return next((d for d in self.shown if d.name == name), None)


def lesson(comparison: Comparison) -> Lesson:
    """Run what the handout asks about on the comparison's drive.

    Raises
    ------
    ValueError
        For a rigid drive, which has no non-collocated control.
    """
    drive = comparison.drive
    if drive.carts != 2:
        raise ValueError("drive: non-collocated control needs a second cart; got a rigid drive. Use one with m2 and k.")
    t = instants(comparison.duration)
    xr = handout_trajectory(t)
    recordings = stability_experiments(drive)
    shown = []
    for section, recording in recordings.items():
        gain, reads = float(recording.excitation.gain or 0.0), recording.excitation.feedback or "x2"
        controller = proportional(gain, "x1" if reads == "x1" else "x2")
        name = f"P({reads}), {_P_TITLES[section]}"
        shown.append(
            _demonstrated(
                drive, controller, name, f"{drive.units.text(gain, 'V/mm')} · (xr - {reads})", reads, RIG_TIME_S, xr
            )
        )
    lab4 = design("lab4", drive, limit=comparison.limit)
    shown.append(
        _demonstrated(
            drive, lab4.controller, "Lab 4", "notch, double lead, integral, feed-forward", "x2", RIG_TIME_S, xr
        )
    )
    learnt = sorted((g for g in comparison.groups if g.learnt), key=lambda g: g.results[0].entry.feedback != "x2")
    if not learnt:
        return Lesson(drive, t, xr, recordings, stability_limit(drive, "x2"), tuple(shown))
    entry = learnt[0].middle.entry
    last = _demonstrated(drive, entry.loop, f"RL ({entry.name})", "learnt policy", entry.feedback, entry.period, xr)
    return Lesson(
        drive, t, xr, recordings, stability_limit(drive, "x2"), (*shown, last), learnt[0].name, len(learnt[0].results)
    )  # fmt: skip


def _demonstrated(
    drive: Drive, controller: Controller, name: str, law: str, reads: str, period: float, xr: FloatArray
) -> Demonstration:
    run = run_many(controller, [drive], xr)[0]
    of = measure(drive, xr, run[:4], run[4], RIG_TIME_S, limit=drive.voltage_limit)
    swings = [float(np.ptp(run[2][d.middle : d.end])) for d in dwells(xr, RIG_TIME_S)]
    on_rig: EmpiricalMargins | None = None
    try:
        on_rig = empirical_margins(drive, controller, on="full")
        swing = on_rig.swing
    except NoMarginsError as error:  # it fails as it is
        swing = error.swing
    linear = margins(drive, controller) if isinstance(controller, LinearController) else None
    parts = error_parts(xr, xr - run[2])
    return Demonstration(name, law, reads, period, run, of, parts, max(swings, default=inf), on_rig, linear, swing)
