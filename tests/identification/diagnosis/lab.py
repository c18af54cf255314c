"""Short data sets for the tests of the diagnosis, and constants that make it quick."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive
from identification.diagnosis.bench import Bench
from identification.diagnosis.settings import Settings
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


def data_set(effects=None, *, force=0.05, kinds=KINDS, t=T, rig=RIG):
    """A few runs of a rig that may have effects; ``force`` is the rms of a white force [V]."""
    drive = Drive({**rig, **COUNTS, **(effects or {})})
    return [
        replace(run(drive, *kind, t=t, force=force, seed=i), quantum=(QUANTUM, QUANTUM)) for i, kind in enumerate(kinds)
    ]


@contextmanager
def bench_of(recordings, settings=QUICK):
    with ThreadPoolExecutor(1) as pool:
        yield Bench(recordings, pool, settings)
