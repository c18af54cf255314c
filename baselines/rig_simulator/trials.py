"""The worlds in which a controller is tried on the concealed rig: without nuisance, for limits; with it, for tracking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from baselines.rig_simulator.ingredients import along_the_track, over_time, rig_values
from baselines.rig_simulator.nuisance import nuisance_of_run, track_of
from baselines.rig_simulator.recordings import experiments
from baselines.rig_simulator.rig import Disturbances, quiet
from baselines.rig_simulator.truth import Truth


def undisturbed(truth: Truth, n: int) -> Disturbances:
    """Return n samples of the rig with its concealed effects and none of its nuisance, from the middle of the track.

    No force noise, no spread between runs, an even track but for what an effect does to it. What drifts over the day is taken as
    it stands in the middle of the day.
    """
    still = quiet(n)
    still = replace(still, track=along_the_track(still.track, truth.effects))
    return over_time(still, truth, len(experiments()) // 2, np.random.default_rng([truth.seed, 8]))


def after_the_day(truth: Truth, n: int, i: int) -> Disturbances:
    """Return n samples of run i after the recordings of the day: the same track, the next draws of the same nuisance."""
    values, order = rig_values(truth), len(experiments()) + i
    track = along_the_track(track_of(truth.nuisance, np.random.default_rng([truth.seed, 3])), truth.effects)
    band = min(values["d1"], values["d2"]) / values["k"]
    world = nuisance_of_run(truth.nuisance, track, n, band, np.random.default_rng([truth.seed, 4, order]))
    return over_time(world, truth, order, np.random.default_rng([truth.seed, 5, order]))
