"""A rig description's known effects are part of the base model that is fitted."""

from dataclasses import replace

import pytest

from flexdrive_gym import Drive
from identification import identify
from identification.recordings import RecordingSet, Rig
from identification.recordings.rig import parse_rig
from identification.topology import topology_of
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, data_set


def test_a_known_ground_spring_is_fitted_with_the_base_model():
    truth = {**RIG, **COUNTS, "ground_spring.kg": 0.02}
    runs = RecordingSet(data_set(Drive(truth), force=0.02), rig=Rig(known=("ground_spring",)))
    found = identify(runs).drive
    assert found["ground_spring.kg"] == pytest.approx(0.02, rel=0.1)
    low, high = found.intervals["ground_spring.kg"]
    assert low < found["ground_spring.kg"] < high
    assert found["k"] == pytest.approx(truth["k"], rel=0.1)
    # the spring that is not there is found to be nothing
    assert abs(found["ground_spring.kg_2"]) < 0.002


def test_a_place_can_be_named():
    runs = RecordingSet(data_set(), rig=Rig(known=("stribeck@cart_1",)))
    free = topology_of(runs).free
    assert any(n.startswith("stribeck.cart_1.") for n in free)
    assert not any(n.startswith("stribeck.cart_2.") for n in free)


def test_a_rig_says_how_many_carts():
    assert topology_of(RecordingSet(data_set(), rig=parse_rig("[rig]\ncarts = 1"))).carts == 1
    assert topology_of(RecordingSet(data_set())).carts == 2


def test_the_filter_of_velocities_without_a_raw_one_is_fitted_with_the_drive():
    truth = {**RIG, **COUNTS, **{f"velocity_processing.encoder_{i}.cutoff": 12.0 for i in (1, 2)}}
    # velocities alone do not tell how they were made
    runs = [replace(r, velocity_cutoff=None) for r in data_set(Drive(truth))]
    found = identify(runs)
    for i in (1, 2):
        q = found.effects[f"velocity_processing.encoder_{i}.cutoff"]
        assert q.value == pytest.approx(12.0, rel=0.05)
        assert q.ci95[0] < 12.0 < q.ci95[1]
    # taken for raw differences these velocities make both masses heavier by 40 %
    assert found.drive["m1"] == pytest.approx(RIG["m1"], rel=0.03)
    assert found.drive["m2"] == pytest.approx(RIG["m2"], rel=0.03)


def test_of_what_makes_no_difference_nothing_is_known():
    runs = [replace(r, velocity_cutoff=None) for r in data_set()[:4]]
    # raw differences, called filtered: beyond some 10 kHz no cut-off shows
    low, high = identify(runs).drive.intervals["velocity_processing.encoder_2.cutoff"]
    assert high - low > 1e3
