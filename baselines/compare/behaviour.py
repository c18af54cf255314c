"""How a chosen few behave: their runs, where in a run their error lies, and what they do to a sine.

Tables say who is better; this says why. Chosen are P-control from x2, Lab 4, LQG, the best classical designs, and of every
learnt group the seed in its middle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from baselines.compare.cases import HANDOUT, Reference
from baselines.compare.comparison import instants
from baselines.compare.result import Result
from baselines.compare.results import Comparison
from baselines.controllers import SAMPLE_TIME_S
from baselines.evaluation.metrics import dwells
from baselines.evaluation.rollout import RIG_TIME_S, run_many
from baselines.loop_analysis.describing_function import AMPLITUDES_MM, Sweep, predicted_gain_margins, sweep
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import measured_in

# rows of a run, and their units
SIGNALS = ("mm", "mm/s", "mm", "mm/s", "V")
FIXED = ("p_x2", "lab4", "lqg")
_END_S = 0.1


@dataclass(frozen=True)
class Parts:
    """Where in a run the tracking error lies.

    Attributes
    ----------
    moving, resting
        rms of xr - x2 while the reference moves, and while it rests [mm]; nan where it never does.
    offset
        Mean |xr - x2| over the last tenth of a second of the rests [mm]; nan without rests.
    """

    moving: float = field(metadata=measured_in("mm"))
    resting: float = field(metadata=measured_in("mm"))
    offset: float = field(metadata=measured_in("mm"))


@dataclass(frozen=True, eq=False)
class Shown:
    """One controller whose behaviour is shown.

    Attributes
    ----------
    runs
        Reference to true x1, v1, x2, v2 and u on the identified drive, ndarray, shape (5, n).
    parts
        Reference to where its error lies.
    sweep
        Describing functions, of learnt policies and Lab 4.
    predicted
        Gain margin that they predict at each amplitude [].
    """

    result: Result
    runs: Mapping[str, FloatArray] = field(metadata=measured_in(SIGNALS))
    parts: Mapping[str, Parts]
    sweep: Sweep | None
    predicted: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Of the controller."""
        return self.result.entry.name


@dataclass(frozen=True, eq=False)
class Behaviour:
    """The chosen few.

    Attributes
    ----------
    t : ndarray, shape (n,)
        [s]
    references
        Name to positions, ndarray, shape (n,) [mm].
    """

    t: FloatArray = field(metadata=measured_in("s"))
    references: Mapping[str, FloatArray] = field(metadata=measured_in("mm"))
    shown: tuple[Shown, ...]

    def find(self, name: str) -> Shown | None:
        """Return one of the chosen by its name."""
        return next((s for s in self.shown if s.name == name), None)


def best_classical(comparison: Comparison, reads: str | None = None) -> Result | None:
    """Return the classical design with the least rms error among those that settle, if any; ``reads`` restricts the encoders."""
    able = [
        r
        for r in comparison.results
        if not r.entry.learnt and r.nominal.success and (reads is None or r.entry.feedback == reads)
    ]
    return min(able, key=lambda r: r.nominal.rms, default=None)


def behaviour(comparison: Comparison) -> Behaviour:
    """Run the chosen few along every reference on the identified drive, and sweep those that learnt."""
    chosen: dict[str, Result] = {r.entry.name: r for r in comparison.results if r.entry.name in FIXED}
    learnt = [g for g in comparison.groups if g.learnt]
    for reads in (None, *(g.results[0].entry.feedback for g in learnt)):
        best = best_classical(comparison, reads)
        if best is not None:
            chosen.setdefault(best.entry.name, best)
    chosen |= {g.middle.entry.name: g.middle for g in learnt}
    t = instants(comparison.duration)
    named = {str(c.reference): c.reference for c in comparison.cases}
    references = {name: named.get(name, Reference(HANDOUT)).sampled(t) for name in (HANDOUT, *comparison.references)}
    return Behaviour(t, references, tuple(_shown(comparison, r, references) for r in chosen.values()))


def _shown(comparison: Comparison, result: Result, references: Mapping[str, FloatArray]) -> Shown:
    entry, drive = result.entry, comparison.drive
    runs = {name: run_many(entry.controller, [drive], xr)[0] for name, xr in references.items()}
    row = 2 if drive.carts == 2 else 0
    parts = {name: error_parts(xr, xr - runs[name][row]) for name, xr in references.items()}
    if not entry.learnt and entry.name != "lab4":
        return Shown(result, runs, parts, None)
    # of a linear controller one small amplitude says all
    swept = sweep(entry.loop, entry.feedback, amplitudes=AMPLITUDES_MM if entry.learnt else AMPLITUDES_MM[:1])
    return Shown(result, runs, parts, swept, predicted_gain_margins(swept, drive))


def error_parts(xr: FloatArray, error: FloatArray) -> Parts:
    """Split a tracking error by what the reference does.

    Parameters
    ----------
    xr, error : ndarray, shape (n,)
        At the rig's samples [mm].
    """
    rests = dwells(xr, RIG_TIME_S)
    resting = np.zeros(len(xr), dtype=np.bool_)
    for rest in rests:
        resting[rest.begin : rest.end] = True
    tail = round(_END_S / SAMPLE_TIME_S)
    ends = [float(np.mean(np.abs(error[max(d.begin, d.end - tail) : d.end]))) for d in rests]
    return Parts(_rms(error[~resting]), _rms(error[resting]), float(np.mean(ends)) if ends else float("nan"))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
