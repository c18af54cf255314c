"""What is known of the real rig's recordings: how they were driven, and where their encoders failed."""

import re

import numpy as np
import pytest

from identification.recordings import read_recordings, write_recording

COUNT = 0.0046592  # mm

# encoder 1 froze in these spans [s], as seen in plots of both carts' speeds
FROZEN_2022 = {
    "sine_2.5V_0.5Hz": [(0.678, 1.117)],
    "sine_2.5V_1.0Hz": [(1.427, 1.557)],
    "sine_2.5V_2.0Hz": [(6.790, 6.873), (7.207, 7.316)],
    "square_1.5V_0.5Hz": [(5.308, 5.506)],
    "pctrl_x2_kp0.05": [(0.595, 0.674)],
    "pctrl_x2_kp0.2345_critical": [(0.243, 0.264), (2.311, 2.866)],
    "pctrl_x2_kp0.235_unstable": [(0.337, 0.516), (1.959, 2.055), (2.316, 2.420)],
}
LOST_2022 = {
    "sine_2.5V_1.0Hz": [2.349],
    "sine_2.5V_2.0Hz": [6.689],
    "square_2.0V_0.5Hz": [6.064],
    "pctrl_x2_kp0.235_unstable": [2.876],
}


@pytest.fixture(scope="module")
def rig_2022(shared_recordings):
    return {run.name: run for run in read_recordings(shared_recordings / "mte360_2022")}


@pytest.fixture(scope="module")
def rig_2025(shared_recordings):
    return {run.name: run for run in read_recordings(shared_recordings / "mte360_2025")}


def dropouts(run, word):
    return [f for f in run.faults if f.id == "encoder_dropout" and word in f.note]


def test_every_run_is_recognised_from_its_data(rig_2022, rig_2025):
    for run in (*rig_2022.values(), *rig_2025.values()):
        drive = run.excitation
        known = re.match(r"(square|sine)_([\d.]+)V_([\d.]+)Hz", run.name)
        if known is not None:
            assert drive.kind == known[1]
            assert drive.amplitude == pytest.approx(float(known[2]), rel=1e-3)
            assert drive.frequency == pytest.approx(float(known[3]), rel=2e-3)
        else:
            _, feedback, gain, *_ = run.name.split("_")
            assert drive.kind == "closed_loop"
            assert drive.feedback == feedback
            assert drive.gain == pytest.approx(float(gain.removeprefix("kp")), rel=1e-4)
            assert drive.limit == (8.0 if "unstable" in run.name else None)


def test_the_encoders_count(rig_2022, rig_2025):
    for run in (*rig_2022.values(), *rig_2025.values()):
        assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-5)
        assert run.velocity_cutoff == 0.0
        assert run.notes == ()


def test_the_frozen_encoder_of_2022(rig_2022):
    for name, run in rig_2022.items():
        found = dropouts(run, "frozen")
        assert all(fault.where == "encoder_1" for fault in found)
        spans = [(fault.start_s, fault.end_s) for fault in found]
        # the sample that an edge cuts belongs to the fault
        np.testing.assert_allclose(spans, FROZEN_2022.get(name, []), atol=1.1e-3, err_msg=name)


def test_the_momentary_losses_of_2022(rig_2022):
    for name, run in rig_2022.items():
        middles = [0.5 * (fault.start_s + fault.end_s) for fault in dropouts(run, "lost counts")]
        np.testing.assert_allclose(middles, LOST_2022.get(name, []), atol=1.6e-3, err_msg=name)


def test_positions_are_offset_after_a_freeze(rig_2022):
    for name in FROZEN_2022:
        lost = [fault for fault in rig_2022[name].faults if fault.id == "lost_counts"]
        if name.startswith("pctrl"):
            (fault,) = lost
            assert fault.start_s == pytest.approx(FROZEN_2022[name][0][1], abs=1.1e-3)
            assert fault.end_s == rig_2022[name].t[-1]
            assert rig_2022[name].valid("x2").all()
        else:
            assert lost == []


def test_the_sticking_carts_of_2025_are_no_faults(rig_2025):
    slow = [run for name, run in rig_2025.items() if name.startswith("square_1.0V")]
    assert min(np.mean(run.v1 == 0.0) for run in slow) > 0.3
    assert [fault for run in rig_2025.values() for fault in run.faults] == []


def test_a_recording_written_and_read_back_keeps_its_faults(rig_2022, tmp_path):
    run = rig_2022["pctrl_x2_kp0.05"]
    (again,) = read_recordings(write_recording(run, tmp_path / f"{run.name}.csv.gz"))
    assert again.faults == run.faults
    np.testing.assert_array_equal(again.x1, run.x1)


def test_a_positioning_system_of_one_cart(shared_recordings):
    (run,) = read_recordings(shared_recordings / "emps")
    assert run.x2 is None
    assert 100.0 < np.ptp(run.x1) < 1000.0  # metres in the file
    assert run.quantum[0] == pytest.approx(5e-5, rel=1e-3)
    assert (run.excitation.kind, run.excitation.gain) == ("closed_loop", None)
