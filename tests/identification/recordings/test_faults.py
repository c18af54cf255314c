from dataclasses import replace

import numpy as np

from flexdrive_gym.recording import Fault, Recording
from identification.recordings import find_faults, recognise_excitation
from identification.recordings.faults import MOST_PLACES, gathered, merge_faults
from tests.identification.recordings.logs import COUNT, closed_loop, recording


def test_a_clean_set_has_no_faults_and_keeps_its_order():
    runs = [recording("b"), recording("a", kind="sine", frequency=2.0)]
    found = find_faults(runs)
    assert [run.name for run in found] == ["b", "a"]
    assert all(run.faults == () for run in found)
    assert find_faults([]) == ()


def test_the_later_of_two_identical_recordings_is_a_duplicate():
    runs = [recording("first"), recording("other", amplitude=1.0), recording("copy")]
    found = find_faults(runs)
    assert found[0].faults == found[1].faults == ()
    (fault,) = found[2].faults
    assert (fault.where, fault.id, fault.note) == ("recording", "duplicate_recording", "identical to first")
    assert (fault.start_s, fault.end_s) == (runs[2].t[0], runs[2].t[-1])
    assert not found[2].valid("v1").any()


def test_replicates_that_differ_in_one_count_are_none():
    v = recording().v1.copy()
    v[100] += COUNT / 1e-3
    assert find_faults([recording("a"), recording("b", v1=v)])[1].faults == ()


def test_recordings_with_other_channels_are_none():
    assert find_faults([recording("a"), recording("b", v2=None)])[1].faults == ()


def test_saturation_of_a_closed_loop_is_reported_and_not_masked():
    t, u, xr, x1, x2 = closed_loop(0.6)
    excitation = recognise_excitation(t, u, x1, x2, xr)
    (run,) = find_faults([Recording("r", t, u, x1=x1, x2=x2, xr=xr, quantum=(COUNT, COUNT), excitation=excitation)])
    spans = [fault for fault in run.faults if fault.id == "saturation"]
    assert len(spans) >= 2
    assert all(fault.where == "actuator" and "limit of 8 V" in fault.note for fault in spans)
    covered = np.zeros(t.size, dtype=bool)
    for fault in spans:
        covered |= (t >= fault.start_s) & (t <= fault.end_s)
    assert np.all(np.abs(u[covered]) == 8.0)
    assert run.valid("x2").all()


def test_squares_rest_at_their_amplitude_without_saturating():
    assert find_faults([recording()])[0].faults == ()


def test_present_faults_are_kept_and_finding_twice_changes_nothing():
    v = recording().v1.copy()
    v[2500:2600] = 0.0
    missing = Fault("run", "recording", "missing_samples", 0.1, 0.2, "interpolated")
    once = find_faults([replace(recording(v1=v), faults=(missing,))])
    assert [fault.id for fault in once[0].faults] == ["missing_samples", "encoder_dropout"]
    assert find_faults(once)[0].faults == once[0].faults


def test_touching_faults_of_one_kind_are_merged_with_their_notes():
    def fault(start, end, note, where="encoder_1", kind="encoder_dropout"):
        return Fault("run", where, kind, start, end, note)

    merged = merge_faults(
        [
            fault(0.5, 0.6, "frozen"),
            fault(0.1, 0.2, "frozen"),
            fault(0.15, 0.3, "lost"),
            fault(0.304, 0.31, "frozen"),
            fault(0.32, 0.33, "frozen"),
            fault(0.1, 0.2, "x", "encoder_2"),
            fault(0.1, 0.4, "y", "encoder_1", "lost_counts"),
        ],
        1e-3,
    )
    assert [(f.where, f.id, f.start_s, f.end_s, f.note) for f in merged] == [
        ("encoder_1", "encoder_dropout", 0.1, 0.31, "frozen; lost"),
        ("encoder_1", "lost_counts", 0.1, 0.4, "y"),
        ("encoder_2", "encoder_dropout", 0.1, 0.2, "x"),
        ("encoder_1", "encoder_dropout", 0.32, 0.33, "frozen"),
        ("encoder_1", "encoder_dropout", 0.5, 0.6, "frozen"),
    ]


def test_what_is_missing_in_very_many_places_is_told_once():
    many = [
        Fault("run", "encoder_1", "missing_samples", 0.1 * i, 0.1 * i, "interpolated") for i in range(MOST_PLACES + 1)
    ]
    few = [Fault("run", "encoder_2", "encoder_dropout", 0.5, 0.7), Fault("run", "actuator", "saturation", 0.0, 1.0)]
    told = gathered([*many, *few])
    assert [(f.where, f.start_s, f.end_s, f.note) for f in told] == [
        ("encoder_1", 0.0, 0.1 * MOST_PLACES, f"in {len(many)} places; interpolated"),
        ("encoder_2", 0.5, 0.7, ""),
    ]
    assert gathered(many[1:]) == many[1:]
