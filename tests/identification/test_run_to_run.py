"""What differs between runs of one rig, and how far its recordings reach."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from identification.replay.output_error import prepare
from identification.run_to_run import _between, friction_run_to_run, recorded_range
from tests.drive.drives import FRICTIONLESS, RIG
from tests.identification.lab import COUNTS, run

FREQUENCIES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)


def data_set(factors):
    """Sines, each with dry friction of its own."""
    made = []
    for i, (frequency, (one, two)) in enumerate(zip(FREQUENCIES, factors, strict=True)):
        rig = Drive({**RIG, **COUNTS, "d1": one * RIG["d1"], "d2": two * RIG["d2"]})
        made.append(run(rig, "sine", 2.5, frequency, force=0.05, seed=i))
    return made


def test_friction_of_every_run_is_found_as_it_was_made():
    logs = np.random.default_rng(5).normal(size=(len(FREQUENCIES), 2)) * [0.25, 0.15]
    found = friction_run_to_run(RIG, [prepare(r) for r in data_set(np.exp(logs))])
    assert found.names == ("d1", "d2")
    made = np.sqrt(np.mean(logs**2, axis=0))
    assert np.sqrt(np.diag(found.matrix)) == pytest.approx(made, rel=0.15)


def test_a_rig_whose_friction_stays_has_none():
    found = friction_run_to_run(RIG, [prepare(r) for r in data_set([(1.0, 1.0)] * len(FREQUENCIES))])
    assert np.sqrt(np.diag(found.matrix)).max() < 0.04


@pytest.mark.slow
def test_random_effects_are_told_from_errors():
    rng = np.random.default_rng(1)
    truth, error = np.array([0.3, 0.1]), 0.2
    z = rng.normal(size=(4000, 2)) * truth + rng.normal(size=(4000, 2)) * error
    found = _between(z, np.tile(np.eye(2) / error**2, (len(z), 1, 1)))
    assert np.sqrt(np.diag(found)) == pytest.approx(truth, rel=0.1)
    # what says nothing counts for nothing
    z[::2], information = 5.0, np.tile(np.eye(2) / error**2, (len(z), 1, 1))
    information[::2] = 0.0
    assert _between(z, information) == pytest.approx(found, abs=0.02)


def test_too_few_runs_or_no_friction_say_nothing():
    runs = [prepare(r) for r in data_set([(1.0, 1.0)] * len(FREQUENCIES))]
    assert friction_run_to_run(RIG, runs[:2]) is None
    assert friction_run_to_run(FRICTIONLESS, runs) is None


def test_recorded_range_is_what_was_commanded_and_reached():
    rig = Drive({**RIG, **COUNTS})
    runs = [run(rig, "sine", 2.5, 3.0), run(rig, "sine", 1.0, 8.0), run(rig, "square", 1.5, 0.5)]
    found = recorded_range(runs)
    assert (found.u, found.slowest) == (2.5, 0.5)
    assert found.fastest == pytest.approx(8.0)
    assert found.v == pytest.approx(max(np.abs(r.v1).max() for r in runs), rel=0.05)
    true = rig.simulate(runs[0].t, runs[0].u)
    assert found.deflection == pytest.approx(np.ptp(true.x1 - true.x2) / 2, rel=0.02)
