"""Rows of residuals: free simulation, and positions where velocities are rounding."""

from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive, Recording
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import KINDS, QUICK, T, bench_of, data_set


def test_a_ground_spring_follows_the_simulation_and_not_the_measured_track():
    values = {**RIG, "ground_spring.kg": 0.05}
    runs = data_set({"ground_spring.kg": 0.05}, force=0.0)
    wrong = [replace(r, v1=r.v1 + 40.0 * (r.t > 0.4995), v2=r.v2 + 40.0 * (r.t > 0.4995)) for r in runs]
    with bench_of(runs) as bench, bench_of(wrong) as other:
        # what was measured moves the rows by itself, and the simulation not at all
        difference = other.residual(values) - bench.residual(values)
    assert set(np.round(difference, 6)) == {0.0, 40.0}


def test_motion_of_a_few_counts_is_compared_by_position():
    t = np.arange(4000) * 1e-3
    q = 0.06
    fine = 0.2 * np.sin(2.0 * np.pi * 0.5 * t)
    small = Recording("small", t, fine, x1=q * np.round(fine / q), quantum=(q, 0.0))
    large = replace(small, name="large", x1=q * np.round(500.0 * fine / q))
    with bench_of([small, large]) as bench:
        assert bench.names == ["large", "small"]
        assert [run.positions for run in bench.runs] == [False, True]


def test_the_true_drive_leaves_nothing():
    drive = Drive(RIG)
    runs = [drive.simulate(T, r.u, name=r.name) for r in data_set(force=0.0, kinds=KINDS[2:])]
    with bench_of([replace(r, x1=None, x2=None) for r in runs]) as bench:
        # a thousandth of what encoder counts leave: events are located to the order of the step, in lanes as singly
        assert np.sqrt(np.mean(bench.residual(RIG) ** 2)) < 1e-3


def test_a_long_day_has_rows_of_twice_the_length():
    """Two neighbours in one: a mean of velocities is the change of position over both."""
    runs = data_set(kinds=KINDS[2:4])
    with bench_of(runs) as bench:
        short = [bench.residual(RIG)[p.rows] for p in bench.pieces]
    with bench_of(runs, replace(QUICK, rows=1000)) as bench:
        long = [bench.residual(RIG)[p.rows] for p in bench.pieces]
    for one, other in zip(short, long, strict=True):
        # the last row is that of a single sample
        pairs = one[:-1].reshape(-1, 2)
        np.testing.assert_allclose(other[:-1], pairs.mean(axis=1), atol=1e-9)


def test_who_rests_rests_in_the_simulation_too():
    """In a slow sine both carts rest; a simulation without dry friction goes on moving, and nothing holds it."""
    with bench_of(data_set(force=0.0, kinds=(("sine", 0.9, 0.5),))) as bench:
        (measured,), (true,), (slippery,) = (
            bench.resting,
            bench.resting_with(RIG),
            bench.resting_with({**RIG, "d1": 0.0, "d2": 0.0}),
        )
    assert np.mean(measured == 3) > 0.2
    assert np.mean(true == measured) > 0.97
    assert not np.any(true & ~measured)
    assert np.mean(slippery > 0) < 0.3 * np.mean(measured > 0)
