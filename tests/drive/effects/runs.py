"""Runs that the tests of the effects share."""

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.effects import EFFECTS
from tests.drive.drives import true_states

BY_ID = {effect.id: effect for effect in EFFECTS}
H = 1e-3


def instants(duration, h=H):
    return np.arange(round(duration / h) + 1) * h


def states(values, u, *, h=H, physics_step=1e-3, start=(0.0, 0.0, 0.0, 0.0)):
    """True x1, v1, x2, v2 at every sample, with the steps that the drive's effects ask for."""
    drive = Drive(values)
    return true_states(drive, u, h, substeps=parameters.substeps(drive.values, h, physics_step), start=start)


def start_values(effect, where):
    """The effect at one place at the first of its plainly present sizes."""
    return {effect.key(where, q.name): q.starts[0] for q in effect.parameters}


INSTANCES = [
    (effect, where)
    for effect in EFFECTS
    for where in effect.where
    if not effect.base and not {"reading", "speed"} & set(effect.hooks)
]
NAMES = [f"{effect.id} {where}" for effect, where in INSTANCES]
