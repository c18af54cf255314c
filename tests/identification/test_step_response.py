"""Handout 3.2 against simulated drives whose truth is known, and on the real rigs."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, Excitation, Fault, LinearDrive, __version__
from identification.half_periods import read_amplitudes
from identification.handout_steps import read_time_constant
from identification.recordings import read_recordings
from identification.step_response import identify_by_handout, iterate_zeta, time_to_63_percent
from tests.each import each

COUNTS = {f"encoder_quantisation.encoder_{i}.quantum": 0.0046592 for i in (1, 2)}
# the handout's own ratios hold exactly
HANDOUT = {"m1": 5e-4, "m2": 2.7e-4, "b1": 8e-3, "b2": 8e-4, "d1": 0.5, "d2": 0.05, "k": 0.09}
# a spring so stiff that the carts move as one
STIFF = {**HANDOUT, "k": 100.0}
RIGID_P = 8.8e-3 / 7.7e-4
ORDER = ["bT", "b1", "b2", "dT", "d1", "d2", "p", "mT", "m1", "m2", "omega_d", "k", "zeta", "omega_n", "C"]


def square(drive: Drive, amplitude: float, *, seconds: float = 8.0, name: str = ""):
    t = 1e-3 * np.arange(round(1e3 * seconds) + 1)
    # like the rig: negative first, and the last sample already belongs to the next half-period
    u = np.where(np.floor(t + 1e-9) % 2 == 0, -amplitude, amplitude)
    run = drive.simulate(t, u, name=name or f"square {amplitude:g}")
    return replace(run, excitation=Excitation("square", amplitude, 0.5))


def data_set(parameters, amplitudes=(1.5, 2.0)):
    drive = Drive({**parameters, **COUNTS})
    return [square(drive, amplitude) for amplitude in amplitudes]


def vss_of(parameters, u0):
    return (u0 - parameters["d1"] - parameters["d2"]) / (parameters["b1"] + parameters["b2"])


def test_steady_velocity_is_equation_5():
    for reading in read_amplitudes(data_set(HANDOUT), 0.54):
        assert reading.vss == pytest.approx(vss_of(HANDOUT, reading.amplitude), rel=0.01)


def test_line_through_two_amplitudes_recovers_friction():
    result = identify_by_handout(data_set(HANDOUT))
    assert result["bT"] == pytest.approx(8.8e-3, rel=0.01)
    assert result["dT"] == pytest.approx(0.55, rel=0.01)


def test_least_squares_line_through_three_amplitudes_recovers_friction():
    result = identify_by_handout(data_set(HANDOUT, (1.25, 1.5, 2.0)))
    assert result["bT"] == pytest.approx(8.8e-3, rel=0.01)
    assert result["dT"] == pytest.approx(0.55, rel=0.01)
    assert "least squares" in result.quantities["bT"].how


def test_first_half_period_is_never_used():
    readings = read_amplitudes(data_set(HANDOUT), 0.54)
    # 8 s at 0.5 Hz are eight half-periods
    assert all(reading.n_averaged == 7 for reading in readings)
    assert all(half.t[0] < 0.0 < half.t[1] for half in readings[0].half_periods)


def test_63_percent_reading_recovers_p_without_friction():
    reading = read_time_constant(read_amplitudes(data_set({**STIFF, "d1": 0.0, "d2": 0.0}), 0.54)[-1], 0.0)
    assert reading.p_read == pytest.approx(RIGID_P, rel=0.02)
    assert reading.bias_percent == 0.0


@each("d", [0.0, 0.3, 0.7, 1.2])
def test_bias_formula_is_that_of_the_rigid_drive_with_coulomb_friction(d):
    m, b, u0 = 7e-4, 9e-3, 2.0
    t = 1e-4 * np.arange(30001)
    run = Drive({"m1": m, "b1": b, "d1": d}).simulate(t, np.where(np.floor(t + 1e-9) % 2 == 0, -u0, u0))
    half, vss = run.v1[10000:20000], (u0 - d) / b
    # the raw difference belongs half a sample earlier
    since = 1e-4 * np.arange(10000) - 0.5e-4
    t63 = np.interp(vss * (1.0 - 2.0 / np.e), half, since)
    assert t63 == pytest.approx(time_to_63_percent(u0, d, b, b / m), rel=0.01)


def test_corrected_reading_is_the_pole_of_a_drive_with_a_stiff_spring():
    reading = read_time_constant(read_amplitudes(data_set(STIFF), 0.54)[-1], 0.55)
    assert reading.p_corrected == pytest.approx(RIGID_P, rel=0.02)
    assert reading.p_read / RIGID_P - 1.0 == pytest.approx(reading.bias_percent / 100.0, abs=0.03)
    # 1/(1 - ln(1 + 0.55/2)) - 1
    assert reading.bias_percent == pytest.approx(32.1, abs=0.1)


def test_handout_keeps_the_biased_p_and_states_the_corrected_one():
    result = identify_by_handout(data_set(HANDOUT))
    reading = result.time_constant
    assert result["p"] == reading.p_read
    assert reading.p_read == pytest.approx((1.0 + reading.bias_percent / 100.0) * reading.p_corrected)
    assert f"corrected for Coulomb friction p = {reading.p_corrected:.4g} 1/s" in str(result)
    # on a spring as soft as the rig's the rigid formula is not the whole bias, and the result says so
    assert any("quarter of the vibration's period" in note for note in result.notes)


def test_simulated_reading_finds_the_pole_of_a_drive_with_a_soft_spring():
    result = identify_by_handout(data_set(HANDOUT))
    # the p of Eq. (6), which is what the handout's masses follow from
    assert result.time_constant.p_consistent == pytest.approx(8.8e-3 / 7.7e-4, rel=0.03)
    masses = identify_by_handout(data_set(HANDOUT), p=result.time_constant.p_consistent)
    assert masses["m1"] == pytest.approx(HANDOUT["m1"], rel=0.04)
    assert result["m1"] < 0.6 * HANDOUT["m1"]


def test_quantities_without_time_to_move_are_refused():
    with pytest.raises(ValueError, match="dT >= u0 does not move"):
        time_to_63_percent(1.0, 1.2, 9e-3, 12.0)


def test_damped_frequency_is_that_of_the_poles():
    result = identify_by_handout(data_set(HANDOUT))
    assert result["omega_d"] == pytest.approx(Drive(HANDOUT).linear.omega_d, rel=0.03)
    assert result.vibration.amplitude == 1.5


def test_damped_frequency_is_read_at_the_smallest_moving_amplitude_without_1_5_volts():
    assert identify_by_handout(data_set(HANDOUT, (1.75, 2.0))).vibration.amplitude == 1.75


def test_zeta_iteration_ends_where_the_poles_have_the_zeta_assumed():
    m1, m2, b1, b2, omega_d = 5e-4, 2.7e-4, 8e-3, 8e-4, 22.0
    last = iterate_zeta(m1, m2, b1, b2, omega_d)[-1]
    assert last.zeta_of_poles == pytest.approx(last.zeta, rel=1e-6)
    assert last.omega_n == pytest.approx(omega_d / np.sqrt(1.0 - last.zeta**2), rel=1e-9)
    assert last.k == pytest.approx(m1 * m2 * last.omega_n**2 / (m1 + m2), rel=1e-9)
    assert LinearDrive(m1, m2, b1, b2, last.k).zeta == pytest.approx(last.zeta, rel=1e-5)


def test_zeta_iteration_does_not_depend_on_the_guess():
    tables = [iterate_zeta(5e-4, 2.7e-4, 8e-3, 8e-4, 22.0, first=zeta) for zeta in (0.01, 0.2)]
    assert tables[0][-1].k == pytest.approx(tables[1][-1].k, rel=1e-5)


def test_zeta_iteration_without_complex_poles_says_so():
    with pytest.raises(ValueError, match="need a complex pair of poles.*pass a smaller p"):
        iterate_zeta(1e-5, 5e-6, 8e-3, 8e-4, 22.0)


def test_quantities_come_in_the_order_of_the_report_and_obey_the_ratios():
    result = identify_by_handout(data_set(HANDOUT))
    assert list(result.quantities) == ORDER
    assert result["m2"] / result["m1"] == pytest.approx(0.54)
    assert result["b2"] / result["b1"] == pytest.approx(0.1)
    assert result["d2"] / result["d1"] == pytest.approx(0.1)
    assert result["mT"] == pytest.approx(result["bT"] / result["p"])
    assert result["C"] == 0.0
    assert all(name in str(result) for name in ORDER)


def test_given_p_replaces_the_reading_and_recomputes_the_masses():
    runs = data_set(HANDOUT)
    result = identify_by_handout(runs, p=11.0)
    assert result["p"] == 11.0
    assert result["mT"] == pytest.approx(result["bT"] / 11.0)
    assert result.quantities["p"].how == "given"
    assert result.time_constant.p_read == identify_by_handout(runs)["p"]


def test_drive_carries_values_and_provenance():
    result = identify_by_handout(data_set(HANDOUT))
    drive = result.drive(**{"saturation.limit": 8.0})
    assert drive["m1"] == result["m1"]
    assert drive.voltage_limit == 8.0
    assert drive.provenance.method == "handout"
    assert drive.provenance.version == __version__
    assert drive.provenance.recordings == ("square 1.5", "square 2")


def test_standard_error_covers_friction_that_changes_between_runs():
    runs = [
        square(Drive({**HANDOUT, "d1": d, **COUNTS}), amplitude, name=f"{amplitude} {d}")
        for amplitude in (1.5, 2.0)
        for d in (0.45, 0.5, 0.55)
    ]
    quantity = identify_by_handout(runs).quantities["dT"]
    assert quantity.standard_error > 0.02
    assert abs(quantity.value - 0.55) < 2.0 * quantity.standard_error


def test_amplitude_at_which_carts_stop_is_left_out_with_a_note():
    result = identify_by_handout(data_set(HANDOUT, (0.5, 1.5, 2.0)))
    assert [reading.amplitude for reading in result.steady] == [1.5, 2.0]
    assert any("±0.5 V: does not move steadily" in note for note in result.notes)
    assert result["dT"] == pytest.approx(0.55, rel=0.01)


def test_one_amplitude_is_an_error_that_names_it():
    with pytest.raises(ValueError, match=r"at least two amplitudes.*got ±2 V\. Record ±1\.5 V and ±2 V"):
        identify_by_handout(data_set(HANDOUT, (2.0,)))
    with pytest.raises(ValueError, match=r"got ±0\.5 V \(stops\), ±2 V"):
        identify_by_handout(data_set(HANDOUT, (0.5, 2.0)))


def test_steady_velocity_that_falls_with_amplitude_is_an_error():
    slow, fast = Drive({**HANDOUT, "d1": 1.6}), Drive({**HANDOUT, "d1": 0.1})
    with pytest.raises(ValueError, match="must rise with the amplitude.*Friction changed"):
        identify_by_handout([square(fast, 1.5), square(slow, 2.0)])


def test_negative_friction_is_an_error():
    quick, sluggish = Drive({**HANDOUT, "d1": 0.2}), Drive({**HANDOUT, "d1": 0.6})
    with pytest.raises(ValueError, match="must give dT >= 0; got dT = -"):
        identify_by_handout([square(quick, 1.5), square(sluggish, 2.0)])


def test_bad_ratio_is_an_error():
    with pytest.raises(ValueError, match="alpha: must be positive; got -1"):
        identify_by_handout(data_set(HANDOUT), alpha=-1.0)


def test_one_cart_is_an_error():
    run = square(Drive({"m1": 7e-4, "b1": 9e-3}), 2.0)
    with pytest.raises(ValueError, match="both carts; got cart 1 alone"):
        identify_by_handout([run])


def test_faulty_samples_do_not_touch_the_result():
    runs = data_set(HANDOUT)
    clean = identify_by_handout(runs)
    v1 = runs[1].v1.copy()
    v1[3300:3500] = 0.0
    fault = Fault(runs[1].name, "encoder_1", "encoder_dropout", 3.3, 3.499)
    faulty = identify_by_handout([runs[0], replace(runs[1], v1=v1, faults=(fault,))])
    assert faulty["bT"] == pytest.approx(clean["bT"], rel=1e-3)
    assert faulty["p"] == pytest.approx(clean["p"], rel=5e-3)
    assert any("sensor faults: 1" in note for note in faulty.notes)


def test_handout_rig_of_2022(shared_recordings):
    result = identify_by_handout(read_recordings(shared_recordings / "mte360_2022"))
    # the steady velocities by eye: 63 mm/s at 1.5 V, 112 mm/s at 2 V
    assert result["bT"] == pytest.approx(0.5 / (112.0 - 63.0), rel=0.05)
    assert result["dT"] == pytest.approx(0.86, abs=0.06)
    assert result["omega_d"] == pytest.approx(20.4, abs=1.0)
    # friction is large there, and so is its bias: 1/(1 - ln(1 + 0.86/2)) - 1
    assert result.time_constant.bias_percent == pytest.approx(56.0, abs=5.0)
    # the encoder fell silent for 0.2 s at 1.5 V
    assert result.amplitudes[0].n_faulty == 1


def test_handout_rig_of_2025_stops_at_small_amplitudes(shared_recordings):
    result = identify_by_handout(read_recordings(shared_recordings / "mte360_2025"))
    assert {reading.amplitude: reading.steady for reading in result.amplitudes} == {
        1.0: False, 1.5: False, 1.75: True, 2.0: True,
    }  # fmt: skip
    assert any("stop in 35 of 35" in note for note in result.notes)
    # two amplitudes 0.25 V apart under changing friction: the error must say that this is no measurement of dT
    dT = result.quantities["dT"]
    assert dT.standard_error > 0.5 * dT.value
