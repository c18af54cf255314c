"""Short simulated runs for the tests of the diagnosis, with forces that no drive explains."""

from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive, Excitation, Recording
from identification.mismatch.crew import Crew
from identification.mismatch.split import Split
from identification.mismatch.verdict import Diagnosis, RecordingFit
from identification.mismatch.workbench import Workbench
from identification.quantities import HANDOUT_RATIOS, Quantity
from identification.replay.output_error import prepare, simulate_run
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, QUANTUM, run

SECONDS = 2.5
T = np.arange(round(SECONDS * 1000) + 1) * 1e-3
SHORT = (("square", 1.5, 0.8), ("square", 2.2, 0.8), ("sine", 2.5, 0.8), ("sine", 2.5, 2.0), ("sine", 2.5, 4.0))


def short_day(effects=None, *, force=0.05, kinds=SHORT, t=T):
    """A few runs of a rig that may have effects; ``force`` is the rms of a white force [V]."""
    rig = Drive({**RIG, **COUNTS, **(effects or {})})
    return [
        replace(run(rig, *kind, t=t, force=force, seed=i), quantum=(QUANTUM, QUANTUM)) for i, kind in enumerate(kinds)
    ]


def workbench(recordings, pool: Crew) -> Workbench:
    return Workbench([prepare(r) for r in recordings], pool)


def pushed_run(values, u, push, *, name="pushed", excitation=None) -> Recording:
    """A run on which additional forces act: ``push``, shape (2, n) [V]."""
    t = np.arange(len(u)) * 1e-3
    still = Recording(
        name, t, u, v1=np.zeros(len(u)), v2=np.zeros(len(u)), excitation=excitation or Excitation("other")
    )
    v1, v2 = simulate_run(values, prepare(still), pushes=push)
    return replace(still, v1=v1, v2=v2)


def diagnosis(**changes) -> Diagnosis:
    """A diagnosis of nothing, to be changed."""
    drive = Drive(RIG)
    recordings = tuple(short_day(kinds=SHORT[:1]))
    nothing = Diagnosis(
        verdict="no_mismatch",
        faults=(),
        located=(),
        findings=(),
        unnamed=None,
        handout_tied_rms=20.0,
        free_rms=8.0,
        ratios={n: Quantity(v, "", ci95=(0.9 * v, 1.1 * v)) for n, v in HANDOUT_RATIOS.items()},
        before_rms=8.0,
        after_rms=8.0,
        floor_rms=float("nan"),
        per_recording=(RecordingFit(recordings[0].name, 8.0, 8.0, float("nan"), held_out=False),),
        predictions=(),
        drive=drive,
        free=drive,
        seconds=1.0,
        split=Split(recordings, (), ()),
    )
    return replace(nothing, **changes)
