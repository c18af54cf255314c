"""What is known of the real rig's recordings: how they were driven, and where their encoders failed."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.readiness.plausible import implausible
from identification.recordings import RecordingError, read_recordings, write_recording
from identification.recordings.rig import parse_rig
from tests.each import each

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


PAGE = Path(__file__).parents[3] / "docs" / "recordings.md"


def described(name):
    """The rig description of that name on the page."""
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return next(rig for rig in map(parse_rig, blocks) if rig.name == name)


def test_workspaces_as_the_students_left_them_hold_the_same_runs(shared_recordings, rig_2025):
    raw = read_recordings(shared_recordings / "mte360_2025_raw")
    assert [(item.file, item.reason) for item in raw.skipped] == [
        ("2-5/1_0V/2-5e.mat", "the same run as 2-5/1_0V/2-5d.mat")
    ]
    assert len(raw) == len(rig_2025)
    left = list(rig_2025.values())
    for run in raw:
        twin = next(other for other in left if _same_signals(run, other))
        left.remove(twin)
        assert (run.quantum, run.faults, str(run.excitation)) == (twin.quantum, (), str(twin.excitation))
        assert run.recorded.date().isoformat() == ("2025-11-20" if run.source.startswith("2-5") else "2025-11-10")
    assert left == []


def _same_signals(one, other):
    def close(name):
        a, b = getattr(one, name), getattr(other, name)
        if a is None or b is None:
            return a is b
        return a.shape == b.shape and np.allclose(a, b, rtol=0.0, atol=1e-3)

    return all(close(name) for name in ("t", "u", "x1", "x2", "v1", "v2", "xr"))


def test_another_makers_rig_in_counts(shared_recordings):
    runs = read_recordings(
        shared_recordings / "ecp210_2025", rig=described("ECP 210"), only=["07-Feb*09_2*", "07*11_32*", "21*1[01]_*"]
    )
    assert [run.source for run in runs[:4]] == [
        f"07-Feb-2025 {clock}.txt" for clock in ("09_20_49", "09_26_10", "09_29_44", "11_32_48")
    ]
    # in closed loop the text holds the target as control effort; the workspace has both, so it is the one that is kept
    assert all(run.source.startswith("closed_loop_mat/") and run.closed_loop for run in runs[4:])
    assert len(runs) == 9
    for run in runs:
        assert run.sample_time == pytest.approx(1.1275e-3, rel=2e-3)
        assert "time stamps rounded to 0.001 s" in " ".join(run.notes)
        assert run.quantum == pytest.approx((0.004413, 0.004413))
        assert run.units.lab
    # a spring to ground holds the carts where the effort is: the signs agree in open and in closed loop
    assert all(np.corrcoef(run.u, run.x1)[0, 1] > 0.5 for run in (*runs[:3], *runs[4:]))
    assert np.max(runs[0].u) == pytest.approx(573 * 0.001221)
    assert "plucked by hand" in " ".join(runs[3].notes)
    assert runs[0].recorded.isoformat() == "2025-02-07T09:20:49"


@each(
    ("folder", "rig", "only", "units"),
    [
        ("lugre_servo", "servo axis", "*_1.txt", ("rad", "N m")),
        ("quanser_2dsfl", "2-DOF serial flexible link", "lqr_full*", ("deg", "A")),
        ("hsm150", "motor bench", "*_1.mat", ("rad", "N m")),
    ],
)
def test_rotary_rigs_by_their_description(shared_recordings, folder, rig, only, units):
    runs = read_recordings(shared_recordings / folder, rig=described(rig), only=[only])
    assert runs.skipped == ()
    for run in runs:
        assert (run.units.length, run.units.command) == units
        assert run.x1 is not None
        assert run.quantum[0] > 0.0
    peaks = [np.max(np.abs(run.u)) for run in runs]
    assert 2.0 / 10**0.5 <= np.median(peaks) <= 2.0 * 10**0.5


def test_without_a_description_a_folder_says_what_to_write(shared_recordings):
    for folder, said in (
        ("lugre_servo", r"no header, the first line is .* by number from 1 to 5: \[columns\]"),
        ("hsm150", r"rig.toml calls the second of data 'data:2'"),
    ):
        with pytest.raises(RecordingError, match=said):
            read_recordings(shared_recordings / folder, only=["*_1.*"])


@each("rig", ["mte360_2022", "mte360_2025"])
def test_exchanged_carts_are_told_from_those_that_are_not(shared_recordings, rig):
    runs = read_recordings(shared_recordings / rig)
    assert not implausible(runs)
    exchanged = [replace(r, x1=r.x2, x2=r.x1, v1=r.v2, v2=r.v1) for r in runs]
    assert "carts" in {item.kind for item in implausible(exchanged)}
