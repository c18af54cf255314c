"""Sine fits, the handout's table (3.4), theory and the describing function."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, Excitation, Fault, LinearDrive
from flexdrive_gym.units import Units, in_rig_units
from identification.frequency_response import (
    fit_sine,
    measure_frequency_response,
    response_with_friction,
    theoretical_response,
)
from identification.recordings import read_recordings
from tests.each import each

LINEAR = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 0.0096, "b2": 0.0032, "k": 0.095}
COUNTS = {f"encoder_quantisation.encoder_{i}.quantum": 0.0046592 for i in (1, 2)}
FREQUENCIES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 8.0, 12.0, 16.0, 20.0)
T = 1e-3 * np.arange(8001)


def sine(drive: Drive, frequency: float, amplitude: float = 2.5):
    run = drive.simulate(T, amplitude * np.sin(2.0 * np.pi * frequency * T), name=f"sine {frequency:g}")
    return replace(run, excitation=Excitation("sine", amplitude, frequency))


def simulated_response(drive: Drive, frequencies, amplitude: float, *, corrected: bool):
    """Run the sine experiment (2.6) on a simulated drive and measure it like a rig."""
    runs = [sine(drive, frequency, amplitude) for frequency in frequencies]
    return measure_frequency_response(runs, model=drive.linear, corrected=corrected)


@each("frequency", [0.5, 3.3, 20.0])
def test_fit_is_exact_for_a_sine_with_offset_and_drift(frequency):
    y = 3.0 * np.sin(2.0 * np.pi * frequency * T + np.deg2rad(-130.0)) + 7.0 + 0.2 * (T - T.mean())
    fit = fit_sine(T, y, frequency)
    assert fit.amplitude == pytest.approx(3.0, rel=1e-9)
    assert fit.phase_deg == pytest.approx(-130.0, abs=1e-7)
    assert fit.offset == pytest.approx(7.0, abs=0.2)
    assert fit.residual_rms < 1e-9


def test_fit_leaves_out_the_transient_and_uses_whole_periods():
    y = np.sin(2.0 * np.pi * 1.5 * T) + 5.0 * np.exp(-T / 0.05)
    fit = fit_sine(T, y, 1.5)
    assert fit.periods == 10  # of the 10.5 in the 7 s after the first second
    assert fit.amplitude == pytest.approx(1.0, rel=1e-6)


def test_odd_harmonics_of_friction_do_not_bias_the_fundamental():
    y = np.sin(2.0 * np.pi * 2.0 * T) + 0.3 * np.sin(2.0 * np.pi * 6.0 * T + 1.0)
    # the drift's column is not quite orthogonal to the harmonic
    assert fit_sine(T, y, 2.0).amplitude == pytest.approx(1.0, rel=1e-3)


def test_masked_samples_do_not_count():
    y = np.sin(2.0 * np.pi * 2.0 * T)
    valid = np.ones(len(T), dtype=bool)
    valid[3000:3200] = False
    fit = fit_sine(T, np.where(valid, y, 1e3), 2.0, valid)
    assert fit.amplitude == pytest.approx(1.0, rel=1e-9)


def test_interval_covers_the_truth_under_coloured_noise():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(60):
        white = rng.normal(size=len(T) + 200)
        # a 0.2 s moving average: neighbours are anything but independent
        noise = np.convolve(white, np.ones(200) / np.sqrt(200.0), "same")[100:-100]
        fit = fit_sine(T, 5.0 * np.sin(2.0 * np.pi * 1.0 * T) + noise, 1.0)
        hits += fit.amplitude_ci[0] <= 5.0 <= fit.amplitude_ci[1]
    # 95 % of 60 is 57, with a standard deviation of 1.7
    assert hits >= 52


def test_single_period_has_no_interval():
    fit = fit_sine(T[:2000], np.sin(2.0 * np.pi * T[:2000]), 1.0)
    assert fit.periods == 1
    assert fit.amplitude_ci[1] == np.inf
    assert not fit.significant


@each(
    ("arguments", "message"),
    [
        ((T, T[:-1], 1.0), "must be vectors of one length"),
        ((T, T, 0.0), "frequency: must be positive"),
        ((T[:1500], T[:1500], 0.5), r"one whole period after the first 2 s; got 0 periods of 0\.5 Hz"),
        ((T, T, 1.0, np.zeros(len(T), dtype=bool)), "three quarters of the samples"),
    ],
)
def test_impossible_fits_say_why(arguments, message):
    with pytest.raises(ValueError, match=message):
        fit_sine(*arguments)


def test_linear_drive_measures_as_its_transfer_function_without_the_lags():
    drive = Drive(LINEAR)
    table = simulated_response(drive, FREQUENCIES, 2.5, corrected=True)
    for cart, output in ((1, "x1"), (2, "x2")):
        exact = drive.linear.frequency_response([row.omega for row in table.rows], output)
        cells = [row.cart(cart) for row in table.rows]
        measured = np.array([cell.gain * np.exp(1j * np.deg2rad(cell.phase_deg)) for cell in cells])
        assert np.abs(measured / exact - 1.0).max() < 0.005


def test_phases_are_as_measured_unless_corrected():
    drive = Drive(LINEAR)
    plain, corrected = (simulated_response(drive, [20.0], 2.5, corrected=c).rows[0] for c in (False, True))
    # hold and difference lag by half a sample each: 20 Hz · 1 ms · 360 deg
    assert corrected.cart1.phase_deg - plain.cart1.phase_deg == pytest.approx(7.2, abs=0.01)


def test_filtered_derivative_is_corrected_too():
    filtered = {f"velocity_processing.encoder_{i}.cutoff": 50.0 for i in (1, 2)}
    row = simulated_response(Drive({**LINEAR, **filtered}), [12.0], 2.5, corrected=True).rows[0]
    exact = LinearDrive(*(LINEAR[name] for name in ("m1", "m2", "b1", "b2", "k"))).frequency_response([row.omega], "x1")
    assert row.cart1.gain == pytest.approx(abs(exact[0]), rel=0.005)
    assert row.cart1.phase_deg == pytest.approx(np.rad2deg(np.angle(exact[0])), abs=0.3)


@each("use_model", [False, True])
def test_phase_of_cart_2_goes_down_to_minus_270_without_jumps(use_model):
    drive = Drive(LINEAR)
    runs = [sine(drive, frequency) for frequency in reversed(FREQUENCIES)]
    table = measure_frequency_response(runs, model=drive.linear if use_model else None)
    assert [row.frequency for row in table.rows] == sorted(FREQUENCIES)
    phase = np.array([row.cart2.phase_deg for row in table.rows])
    assert (np.diff(phase) < 0.0).all()
    assert phase[0] > -45.0
    assert -285.0 < phase[-1] < -250.0
    # v1 itself stays within ±90 deg; the sampling's lag adds up to 7.2 deg
    assert all(-98.0 < row.cart1.phase_deg < 90.0 for row in table.rows)


def test_model_puts_a_single_fast_sine_on_its_branch():
    drive = Drive(LINEAR)
    row = measure_frequency_response([sine(drive, 5.0)], model=drive.linear).rows[0]
    assert row.cart2.phase_deg == pytest.approx(theoretical_response(drive.linear).phase(2)[-1] + 20.0, abs=30.0)


def test_motion_below_one_count_is_flagged_and_has_no_phase():
    drive = Drive({**LINEAR, "k": 0.01, "d2": 0.02, **COUNTS})
    row = measure_frequency_response([sine(drive, 20.0, 1.0)]).rows[0]
    assert row.cart2.flag == "below resolution"
    assert row.cart2.phase_deg is None
    assert row.cart1.flag == ""
    assert "below resolution" in str(measure_frequency_response([sine(drive, 20.0, 1.0)]))


def test_faulty_sensor_takes_one_cell_from_the_table():
    run = sine(Drive(LINEAR), 2.0)
    broken = replace(run, faults=(Fault(run.name, "encoder_2", "encoder_dropout", 0.0, 8.0),))
    table = measure_frequency_response([broken])
    assert table.rows[0].cart1 is not None
    assert table.rows[0].cart2 is None
    assert "cart 2" in table.notes[0]


def test_table_has_the_handouts_columns():
    table = measure_frequency_response([sine(Drive(LINEAR), 2.0)])
    columns, rows = table.as_table()
    assert columns == [
        "Frequency [Hz]",
        "Gain v1/u [(mm/s)/V]",
        "Phase ∠(v1/u) [deg]",
        "Gain v2/u [(mm/s)/V]",
        "Phase ∠(v2/u) [deg]",
    ]
    assert [len(row) for row in rows] == [5]
    assert table.amplitude == pytest.approx(2.5, rel=1e-3)
    assert all(column in str(table) for column in columns)


def test_table_needs_a_sine():
    with pytest.raises(ValueError, match="at least one must be a sine run"):
        measure_frequency_response([])


def test_theory_starts_at_the_static_gain_and_ends_at_the_masses():
    drive = Drive(LINEAR)
    response = theoretical_response(drive.linear)
    assert len(response.omega) == 1000
    assert response.omega[[0, -1]] == pytest.approx([0.1, 1000.0])
    static = 1.0 / (LINEAR["b1"] + LINEAR["b2"])
    assert response.gain(1)[0] == pytest.approx(static, rel=1e-3)
    assert response.gain(2)[0] == pytest.approx(static, rel=1e-3)
    assert response.gain(1)[-1] == pytest.approx(1.0 / (LINEAR["m1"] * 1e3), rel=0.01)
    assert response.phase(1)[-1] == pytest.approx(-90.0, abs=2.0)
    assert response.phase(2)[-1] == pytest.approx(-270.0, abs=2.0)


def test_describing_function_without_friction_is_the_linear_response():
    drive = Drive(LINEAR)
    quasi, linear = (
        response_with_friction(drive, [1.0, 20.0, 200.0], 2.0),
        theoretical_response(drive.linear, [1.0, 20.0, 200.0]),
    )
    assert quasi.v1 == pytest.approx(linear.v1, rel=1e-9)
    assert quasi.v2 == pytest.approx(linear.v2, rel=1e-9)


def test_describing_function_satisfies_the_harmonic_balance():
    drive = Drive({**LINEAR, "d1": 0.4, "d2": 0.2})
    amplitude, omega = 2.5, np.array([3.0, 12.0, 20.0, 30.0])
    response = response_with_friction(drive, omega, amplitude)
    for w, v1, v2 in zip(omega, amplitude * response.v1, amplitude * response.v2, strict=True):
        spring = LINEAR["k"] / (1j * w) * (v1 - v2)
        friction = [4.0 * drive[d] / np.pi * v / abs(v) for d, v in (("d1", v1), ("d2", v2))]
        assert (1j * w * LINEAR["m1"] + LINEAR["b1"]) * v1 + spring + friction[0] == pytest.approx(amplitude)
        assert (1j * w * LINEAR["m2"] + LINEAR["b2"]) * v2 - spring + friction[1] == pytest.approx(0.0, abs=1e-9)


def test_describing_function_predicts_the_simulated_gain_where_friction_is_small():
    drive = Drive({**LINEAR, "d1": 0.25, "d2": 0.05})
    frequencies = [f for f in FREQUENCIES if f <= 8.0]
    table = simulated_response(drive, frequencies, 2.5, corrected=True)
    theory = response_with_friction(drive, [row.omega for row in table.rows], 2.5)
    for i, row in enumerate(table.rows):
        assert row.cart1.gain == pytest.approx(theory.gain(1)[i], rel=0.02)
        assert row.cart1.phase_deg == pytest.approx(theory.phase(1)[i], abs=2.0)
        # far above resonance friction is no longer small beside the spring's force on cart 2
        if row.frequency <= 5.0:
            assert row.cart2.gain == pytest.approx(theory.gain(2)[i], rel=0.02)
    # and it matters: the linear gain is a tenth higher at 0.5 Hz
    assert theoretical_response(drive.linear, [np.pi]).gain(1)[0] > 1.1 * table.rows[0].cart1.gain


def test_describing_function_sticks_below_the_friction():
    drive = Drive({**LINEAR, "d1": 0.5, "d2": 0.2})
    assert (response_with_friction(drive, np.logspace(-1, 3, 20), 0.6).v1 == 0.0).all()
    # far above resonance the spring cannot move cart 2
    response = response_with_friction(drive, [300.0], 2.5)
    assert response.gain(1)[0] > 0.0
    assert response.gain(2)[0] == 0.0
    assert np.isnan(response.phase(2)[0])


def test_rigid_drive_has_one_response():
    response = response_with_friction(Drive({"m1": 1e-3, "b1": 0.01, "d1": 0.2}), [1e-3], 2.0)
    assert response.gain(1)[0] == pytest.approx((2.0 - 4.0 * 0.2 / np.pi) / 0.01 / 2.0, rel=1e-6)
    assert np.isnan(response.gain(2)[0])


def test_handout_rig_of_2022(shared_recordings):
    table = measure_frequency_response(read_recordings(shared_recordings / "mte360_2022"))
    assert tuple(row.frequency for row in table.rows) == pytest.approx(FREQUENCIES, rel=1e-3)
    assert all(row.u_amplitude == pytest.approx(2.5, rel=0.01) for row in table.rows)
    # v2 rises and falls by single counts at 8 and 16 Hz
    flags = {round(row.frequency, 1): row.cart2.flag for row in table.rows}
    assert flags[8.0] == flags[16.0] == "below resolution"
    phase = [row.cart2.phase_deg for row in table.rows if row.cart2.phase_deg is not None]
    assert phase[0] > -30.0
    assert min(phase) < -200.0
    assert max(abs(step) for step in np.diff(phase)) < 180.0
    # far below resonance the carts move as one
    assert table.rows[0].cart1.gain == pytest.approx(table.rows[0].cart2.gain, rel=0.05)


def test_a_row_in_the_units_of_another_rig():
    rotary = Units("rad", "N m", per_length=100.0, per_command=50.0)
    run = replace(sine(Drive(LINEAR), 2.0), units=rotary)
    (row,) = measure_frequency_response([run]).rows
    (told,) = in_rig_units((row,), rotary)
    assert told.u_amplitude == pytest.approx(2.5 / 50.0)
    assert told.cart1.gain == pytest.approx(row.cart1.gain * 50.0 / 100.0)
    assert told.cart1.fit.amplitude == pytest.approx(told.cart1.gain * told.u_amplitude)
    assert (told.frequency, told.cart1.phase_deg) == (row.frequency, row.cart1.phase_deg)
    assert told.cart1.fit.phase_deg == row.cart1.fit.phase_deg
