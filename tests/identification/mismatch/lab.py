"""Short data sets for the tests of the diagnosis, and constants that make it quick."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive, Excitation, Recording
from identification.mismatch.answer.verdict import Diagnosis, RecordingFit
from identification.mismatch.fitting.bench import Bench
from identification.mismatch.fitting.thread_pool import ThreadPool
from identification.mismatch.settings import Settings
from identification.mismatch.split import Split
from identification.quantities import HANDOUT_RATIOS, Quantity
from identification.replay.output_error import prepare, simulate_run
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, QUANTUM, run

QUICK = Settings(draws=199, finished=3, rounds=2)
T = np.arange(2501) * 1e-3
KINDS = (
    ("square", 1.5, 0.8),
    ("square", 2.2, 0.8),
    ("sine", 2.5, 0.8),
    ("sine", 2.5, 2.0),
    ("sine", 2.5, 3.0),
    ("sine", 2.5, 4.0),
)


def data_set(effects=None, *, force=0.05, kinds=KINDS, t=T, rig=RIG, first=0):
    """A few runs of a rig that may have effects; ``force`` is the rms of a white force [V], drawn from seeds ``first`` on."""
    drive = Drive({**rig, **COUNTS, **(effects or {})})
    return [
        replace(run(drive, *kind, t=t, force=force, seed=first + i), quantum=(QUANTUM, QUANTUM))
        for i, kind in enumerate(kinds)
    ]


@contextmanager
def bench_of(recordings, settings=QUICK):
    with ThreadPool(2) as pool:
        yield Bench(recordings, pool, settings)


def pushed_run(values, u, push, *, name="pushed", excitation=None):
    """A run on which additional forces act: ``push``, shape (2, n) [V]."""
    t = np.arange(len(u)) * 1e-3
    still = Recording(
        name, t, u, v1=np.zeros(len(u)), v2=np.zeros(len(u)), excitation=excitation or Excitation("other")
    )
    v1, v2 = simulate_run(values, prepare(still), pushes=push)
    return replace(still, v1=v1, v2=v2)


def diagnosis(**changes):
    """A diagnosis of nothing, to be changed."""
    drive = Drive(RIG)
    recordings = tuple(data_set(kinds=KINDS[:1]))
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
        per_recording=(RecordingFit(recordings[0].name, "estimation", 8.0, 8.0),),
        homogeneity=(),
        drive=drive,
        base=drive,
        seconds=1.0,
        split=Split(recordings, (), ()),
    )
    return replace(nothing, **changes)
