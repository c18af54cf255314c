"""Recordings side by side give the residuals that each gives by itself."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.accuracy import FAST, fast_errors
from flexdrive_gym import Drive
from identification.replay.batch import RunBatch
from identification.replay.output_error import PHYSICS_S, prepare, simulate_run
from tests.drive.drives import RIG
from tests.each import each
from tests.identification.mismatch.lab import KINDS, data_set

DRIVES = [
    RIG,
    {**RIG, "presliding.cart_1.fd": 0.2, "presliding.cart_1.xs": 0.3},
    {**RIG, "cogging.a_sin": 0.1, "cogging.P": 25.0},
]


@pytest.fixture(scope="module")
def runs():
    return [prepare(r) for r in data_set(kinds=KINDS[:3])]


def alone(values, run, offset=0.0, pushes=None):
    """Block means the long way."""
    simulated = simulate_run(values, replace(run, track=run.track + offset), pushes=pushes)
    found = []
    for measured, y, keep in zip(run.measured, simulated, run.keep, strict=True):
        for begin in range(0, len(run.u), run.block):
            part = slice(begin, begin + run.block)
            error = (measured - y)[part][keep[part]]
            found.append(error.mean() if len(error) else 0.0)
    return np.array(found)


@each("values", DRIVES)
def test_every_recording_as_by_itself(runs, values):
    offsets = np.linspace(0.0, 5.0, len(runs))
    expected = np.concatenate([alone(values, run, o) for run, o in zip(runs, offsets, strict=True)])
    assert RunBatch(runs).residual(values, offsets) == pytest.approx(expected, abs=1e-9)


def test_some_of_them_each_with_a_drive_and_a_push_of_its_own(runs):
    pushes = [0.05 * np.ones((2, len(run.u))) for run in runs[1:3]]
    expected = [alone(v, run, pushes=f) for v, run, f in zip(DRIVES[:2], runs[1:3], pushes, strict=True)]
    found = RunBatch(runs).residual(DRIVES[:2], np.zeros(len(runs)), 1, 3, pushes)
    assert found == pytest.approx(np.concatenate(expected), abs=1e-9)


def test_positions_and_a_command_that_was_continuous(runs):
    run = runs[0]
    fine = np.repeat(run.u, 2)
    one = replace(run, fine=fine, cutoff=0.0)
    for positions in (False, True):
        other = replace(one, positions=positions)
        found = RunBatch([other]).residual(RIG, np.zeros(1))
        assert found == pytest.approx(alone(RIG, other), abs=1e-6)


def test_a_drive_that_runs_away_leaves_a_number(runs):
    residual = RunBatch(runs).residual({**RIG, "m1": 1e-9, "m2": 1e-9, "k": 50.0, "b1": 5.0}, np.zeros(len(runs)))
    assert np.all(np.isfinite(residual))


@each(
    "own",
    [
        {},
        {"presliding.cart_1.fd": 0.2, "presliding.cart_1.xs": 0.3},
        {"cogging.a_sin": 0.1, "cogging.P": 25.0},
        {"stribeck.cart_1.extra": 0.1, "stribeck.cart_1.vs": 15.0},
        {"amplifier_lag.tau": 4e-3},
        {"load_friction.cart_2.mu": 0.05},
        {"coupling_backlash.g": 0.3},
    ],
)
@each("motion", [(0.5, 1.0), (2.0, 2.5), (4.0, 2.5)])
def test_the_longest_step_is_short_enough(own, motion):
    """Far below the 5 mm/s that an encoder of 0.026 mm resolves in a block."""
    frequency, amplitude = motion
    t = np.arange(2001) * PHYSICS_S
    run = prepare(Drive(RIG).simulate(t, amplitude * np.sin(2.0 * np.pi * frequency * t)))
    values = {**RIG, **own}
    long, short = (np.array(simulate_run(values, run, step)) for step in (PHYSICS_S, 1e-4))
    assert np.sqrt(np.mean((long - short) ** 2)) < (2e-3 if "coupling_backlash.g" in own else 3e-4)


@each("effect", list(FAST))
def test_a_fast_effect_takes_steps_that_are_short_enough(effect):
    """A hundredth of what an encoder of 0.026 mm rounds the mean over a block by; a contact, which no event bounds, a tenth."""
    errors, changes = fast_errors(effect, 40)
    rounding = 0.026 / 5e-3 / np.sqrt(6.0)
    assert np.quantile(errors, 0.9) < (0.1 if effect == "motor_gear_backlash" else 0.01) * rounding
    assert np.median(changes) > 10.0 * np.median(errors)
