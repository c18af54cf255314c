"""Data sets in which nothing is left out."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Recording
from identification.mismatch.noise.estimate import Forces, first_noise
from identification.mismatch.noise.nuisance import directions
from identification.mismatch.noise.simulator import Simulator
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set


def test_draws_under_unknown_forces_are_white_once_whitened():
    rig = {**RIG, "d1": 0.0, "d2": 0.0}
    with bench_of(data_set(force=0.0, rig=rig)[2:4]) as bench:
        noise = replace(first_noise(bench, rig), forces=Forces((5e-3, 2e-3), (0.02, 0.01), 0.2))
        simulator = Simulator(bench, rig, noise, ())
        white = noise.white(simulator.rows(range(8), [1]))
        moving = white[bench.moves]
        assert np.sqrt(np.mean(moving**2)) == pytest.approx(1.0, abs=0.12)
        again = noise.white(simulator.rows(range(8), [1]))
        assert np.array_equal(white, again)


def test_draws_of_a_drive_that_sticks_are_white_at_rest_and_in_motion():
    """Its noise knows where it rests; around another drive draws rest at other instants, and are no noise."""
    kinds = (("sine", 0.9, 0.5), ("square", 1.0, 0.8), ("sine", 1.5, 1.2))
    with bench_of(data_set(kinds=kinds, t=np.arange(5001) * 1e-3)) as bench:
        noise = replace(first_noise(bench, RIG), forces=Forces((5e-3, 2e-3), (0.05, 0.03), 0.2))
        own, other = (
            noise.white(Simulator(bench, drive, noise, ()).rows(range(40), [1]))
            for drive in (RIG, {**RIG, "input_offset.u0": 0.1})
        )
    for which in (bench.moves, ~bench.moves):
        assert np.sqrt(np.mean(own[which] ** 2)) == pytest.approx(1.0, abs=0.15)
    assert np.sqrt(np.mean(other[~bench.moves] ** 2)) > 1.5


def test_a_draw_does_not_depend_on_those_that_are_made_with_it():
    with bench_of(data_set(force=0.0)[2:4]) as bench:
        noise = replace(first_noise(bench, RIG), forces=Forces((5e-3, 2e-3), (0.02, 0.01), 0.2))
        simulator = Simulator(bench, RIG, noise, directions(bench, RIG))
        many, one = simulator.rows(range(30), [1]), simulator.rows(range(25, 26), [1])
        assert many[:, 25] == pytest.approx(one[:, 0], abs=1e-3 * float(np.std(one)))


def test_forces_shake_a_drive_alike_however_fast_it_was_sampled():
    """White forces have an intensity, and slow ones a standard deviation: both are the rig's, and not the log's."""
    rig = {**RIG, "d1": 0.0, "d2": 0.0}
    fine = data_set(force=0.0, rig=rig)[2:4]
    # every fifth sample: 5 ms, as long as a row
    coarse = [Recording(r.name, r.t[::5], r.u[::5], v1=r.v1[::5], v2=r.v2[::5]) for r in fine]
    found = []
    for runs in (fine, coarse):
        with bench_of(runs) as bench:
            noise = replace(first_noise(bench, rig), forces=Forces((5e-3, 2e-3), (0.02, 0.01), 0.2))
            found.append(np.std(Simulator(bench, rig, noise, ()).rows(range(60), [1])))
    assert found[1] == pytest.approx(found[0], rel=0.05)
