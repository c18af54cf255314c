"""Drives that the tests of the physics share; sizes are those of the handout's rig."""

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.effects import WORKSPACE
from flexdrive_gym.drive.sample import WORK_SPACE

RIG = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 0.0096, "b2": 0.0032, "d1": 0.357, "d2": 0.241, "k": 0.095}
FRICTIONLESS = {**RIG, "d1": 0.0, "d2": 0.0}


def true_states(drive: Drive, u, sample_time=1e-3, *, substeps=1, start=(0.0, 0.0, 0.0, 0.0), full=False):
    """x1, v1, x2, v2 themselves, not what encoders report; ``full`` forces the variant with every effect."""
    n = len(u)
    readings, states = np.empty((4, n)), np.empty((4, n))
    z = np.zeros(WORKSPACE) if full else parameters.workspace(drive.values)
    start = np.array(start, dtype=float)
    kernels.run_open_loop(
        np.asarray(u, dtype=float),
        sample_time,
        substeps,
        start,
        np.zeros(WORK_SPACE),
        z,
        drive.vector(),
        readings,
        states,
    )
    return states
