"""Units: what a rig's owner reads is the engine's figure in other units, and files give back what went in."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from flexdrive_gym import Covariance, Drive, Recording, load_drive, save_drive
from flexdrive_gym.drive.drive import Recorded
from flexdrive_gym.recording import Excitation, Fault
from flexdrive_gym.units import LAB, Units, in_rig_units, measured_in
from tests.drive.drives import RIG
from tests.each import each

METRES = Units("m", "V", per_length=1000.0)
ROTARY = Units("rad", "N m", per_length=100.0, per_command=50.0)
SLOW = Units("V", "V", per_length=100.0, per_command=20.0, per_time=3.0)


@each(
    ("unit", "factor", "name"),
    [  # by hand: 1 V/mm is 1000 V/m
        ("mm", 1e-3, "m"),
        ("mm/s", 1e-3, "m/s"),
        ("V/mm", 1e3, "V/m"),
        ("V s²/mm", 1e3, "V s²/m"),
        ("V/mm³", 1e9, "V/m³"),
        ("(mm/s)/V", 1e-3, "(m/s)/V"),
        ("Hz", 1.0, "Hz"),
        ("1/s", 1.0, "1/s"),
        ("", 1.0, ""),
    ],
)
def test_millimetres_to_metres(unit, factor, name):
    assert METRES.of_rig(1.0, unit) == (pytest.approx(factor), name)
    assert METRES.to_engine(METRES.of_rig(0.7, unit)[0], unit) == pytest.approx(0.7)


def test_the_equation_of_motion_holds_in_either_units():
    """m·a + b·v + k·x is a command: every term has the same value in the rig's units of command."""
    m, b, k, a, v, x = 5e-4, 8e-3, 0.09, 2000.0, 150.0, 20.0
    terms = [(m, "V s²/mm", a, "mm/s²"), (b, "V s/mm", v, "mm/s"), (k, "V/mm", x, "mm")]
    for units in (METRES, ROTARY, SLOW):
        for value, unit, motion, of_motion in terms:
            there = units.of_rig(value, unit)[0] * units.of_rig(motion, of_motion)[0]
            assert there == pytest.approx(units.of_rig(value * motion, "V")[0])


def test_names_leave_other_words_alone():
    assert ROTARY.name("velocity [mm/s] of a comma, VAF, summed") == "velocity [rad/s] of a comma, VAF, summed"
    assert ROTARY.text(2.5, "V s/mm") == "5 N m s/rad"


def test_time_of_a_slowed_rig():
    assert SLOW.of_rig(22.0, "Hz") == (pytest.approx(66.0), "Hz")


def test_a_drive_file_is_in_the_rigs_units(tmp_path):
    covariance = Covariance(("m1", "k"), np.array([[1e-10, 2e-9], [2e-9, 1e-6]]))
    values = {"m1": 1e-3, "m2": 5e-4, "b1": 0.01, "k": 0.09, "d1": 0.3, "hardening_spring.k3": 1e-5}
    drive = Drive(values, {"k": (0.08, 0.1)}, covariance, units=ROTARY)
    text = save_drive(drive, tmp_path / "drive.toml").read_text(encoding="utf-8")
    assert 'k = {value = 0.18, unit = "N m/rad", ci95 = [0.16, 0.2]}' in text
    again = load_drive(tmp_path / "drive.toml")
    assert again.units == ROTARY
    assert dict(again.values) == pytest.approx(dict(drive.values))
    assert again.intervals["k"] == pytest.approx((0.08, 0.1))
    np.testing.assert_allclose(again.covariance.matrix, covariance.matrix)


@each(("line", "match"), [("per_length = -1.0", "per_length must be a positive number; got -1.0"),
                                             ("lenght = 'mm'", "got 'lenght'")])  # fmt: skip
def test_a_drive_file_with_wrong_units_is_refused(tmp_path, line, match):
    path = save_drive(Drive({"m1": 1e-3}, units=METRES), tmp_path / "drive.toml")
    path.write_text(path.read_text(encoding="utf-8").replace("per_length = 1000.0", line), encoding="utf-8")
    with pytest.raises(ValueError, match=match):
        load_drive(path)


def test_a_recording_in_the_rigs_units():
    t = np.arange(5) / 1000.0
    run = Recording("a", t, np.full(5, 2.0), x1=np.arange(5.0), v2=np.arange(5.0), quantum=(0.1, 0.0),
                    excitation=Excitation("closed_loop", 40.0, 1.0, "x2", 0.2, 8.0),
                    faults=(Fault("a", "encoder_1", "x", 0.001, 0.002),), units=ROTARY)  # fmt: skip
    seen = run.in_rig_units()
    np.testing.assert_allclose(seen.x1, np.arange(5) / 100.0)
    np.testing.assert_allclose(seen.u, 0.04)
    assert seen.excitation.gain == pytest.approx(0.2 / 50.0 * 100.0)
    assert seen.excitation.amplitude == pytest.approx(0.4)
    assert str(run.excitation.text(ROTARY)) == "P-control from x2, Kp = 0.4 N m/rad"
    assert run.excitation.text() == "P-control from x2, Kp = 0.2 V/mm"
    # what is readable already stays as it is
    np.testing.assert_allclose(seen.in_rig_units().x1, seen.x1)


def test_lab_units_change_nothing():
    run = Recording("a", np.arange(5) / 1000.0, np.ones(5), v1=np.ones(5))
    assert run.in_rig_units() is run
    assert LAB.lab
    assert Drive({"m1": 1e-3}).simulate(run.t, run.u).units.lab
    assert Drive({"m1": 1e-3}, units=METRES).simulate(run.t, run.u).units == METRES


def test_a_drive_on_another_scale_is_the_same_drive():
    """k·x is the same command whatever the scale, and the covariance scales with it."""
    covariance = Covariance(("m1", "k"), np.array([[1e-10, 2e-9], [2e-9, 1e-6]]))
    values = {"m1": 1e-3, "m2": 5e-4, "b1": 0.01, "k": 0.09, "d1": 0.3, "encoder_quantisation.encoder_1.quantum": 0.005}
    drive = Drive(
        values, {"k": (0.08, 0.1)}, covariance, units=ROTARY, recorded=Recorded(2.5, 150.0, 10.0, travel=80.0)
    )
    other = drive.rescaled(Units("rad", "N m", per_length=17.0, per_command=3.0))
    for scale in (other, drive.in_rig_units()):
        for name, unit in (("m1", "V s²/mm"), ("b1", "V s/mm"), ("k", "V/mm"), ("d1", "V")):
            assert scale.units.of_rig(scale[name], unit)[0] == pytest.approx(ROTARY.of_rig(drive[name], unit)[0])
        assert scale.intervals["k"][0] / scale["k"] == pytest.approx(0.08 / 0.09)
        spread, was = (np.sqrt(d.covariance.matrix[1, 1]) / d["k"] for d in (scale, drive))
        assert spread == pytest.approx(was)
        assert scale.units.of_rig(scale.recorded.travel, "mm")[0] == pytest.approx(0.8)
        assert scale.units.of_rig(scale.recorded.u, "V")[0] == pytest.approx(0.05)
    # what the rig's owner reads
    assert drive.in_rig_units()["k"] == pytest.approx(0.09 / 50.0 * 100.0)
    assert drive.rescaled(ROTARY) is drive


@dataclass(frozen=True)
class _Inner:
    gain: float = field(metadata=measured_in("V/mm"))


@dataclass(frozen=True)
class _Result:
    error: float | None = field(metadata=measured_in("mm"))
    inner: _Inner
    by_limit: dict[float, _Inner] = field(metadata=measured_in("", keys="V"))
    run: np.ndarray = field(metadata=measured_in(("mm", "V")))
    kept: _Inner = field(metadata=measured_in(None))
    share: float = 0.3


def test_a_whole_result_in_the_rigs_units():
    found = _Result(4.0, _Inner(2.0), {8.0: _Inner(2.0)}, np.ones((2, 3)), _Inner(2.0))
    told = in_rig_units(found, ROTARY)
    assert told.error == pytest.approx(0.04)
    assert told.inner.gain == pytest.approx(2.0 / 50.0 * 100.0)
    assert told.by_limit == {8.0 / 50.0: told.inner}
    np.testing.assert_allclose(told.run, [[0.01] * 3, [0.02] * 3])
    assert told.kept.gain == 2.0
    assert told.share == 0.3
    assert in_rig_units(found, LAB) is found
    assert in_rig_units(_Result(None, _Inner(1.0), {}, np.ones((2, 1)), _Inner(1.0)), ROTARY).error is None


def test_labels_are_renamed_in_brackets_only():
    assert ROTARY.label("peak [mm] of Lab 4 at V, [V/mm]") == "peak [rad] of Lab 4 at V, [N m/rad]"


def test_a_recording_on_another_scale_is_the_same_motion():
    scale = Units("rad", "N m", per_length=20.0, per_command=0.5, per_time=2.0)
    drive = Drive({**RIG, **{f"encoder_quantisation.encoder_{i}.quantum": 0.01 for i in (1, 2)}}, units=scale)
    t = np.arange(1000) * 1e-3
    run = replace(
        drive.simulate(t, 2.0 * np.sign(np.sin(8.0 * t + 1e-9))), excitation=Excitation("square", 2.0, 4.0 / np.pi)
    )
    other = run.rescaled(ROTARY)
    assert other.units == ROTARY
    # seen by the rig's owner it is what it was
    for name in ("t", "u", "x1", "v2"):
        np.testing.assert_allclose(getattr(other.in_rig_units(), name), getattr(run.in_rig_units(), name))
    assert other.excitation.text(ROTARY) == run.excitation.text(scale)
    # and the drive on that scale makes it again
    again = drive.rescaled(ROTARY).simulate(other.t, other.u)
    np.testing.assert_allclose(again.x2, other.x2, atol=2.0 * other.quantum[1])


@each(
    ("units", "turn"),
    [
        (LAB, None),
        (METRES, None),
        (ROTARY, 200.0 * np.pi),
        (Units("deg", "A", per_length=2.0), 720.0),
        (Units("Turns", "V"), 1.0),
    ],
)
def test_an_angle_has_a_turn(units, turn):
    assert units.revolution == (None if turn is None else pytest.approx(turn))
