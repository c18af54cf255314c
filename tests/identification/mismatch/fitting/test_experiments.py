"""Replicates of one experiment are one unit of validation."""

from dataclasses import replace

from identification.mismatch.fitting.experiments import FEWEST, experiments
from tests.identification.mismatch.lab import data_set

MANY = (*(("sine", 2.5, f) for f in (0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2)), ("square", 1.5, 0.8), ("square", 2.2, 0.8))


def test_replicates_are_one_unit_and_other_amplitudes_are_not():
    runs = data_set(kinds=MANY)
    again = replace(runs[-1], name="again", u=1.01 * runs[-1].u)
    found = experiments([*runs, again])
    assert found[-1] == found[-2]
    assert len(set(found)) == len(runs)


def test_few_experiments_leave_every_recording_its_own_unit():
    runs = data_set()[:2]
    found = experiments([*runs, replace(runs[0], name="again")])
    assert len(runs) < FEWEST
    assert list(found) == [0, 1, 2]
