"""Fits, floor and residual tests do what their definitions say."""

from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, Excitation, PControl
from flexdrive_gym.references import handout_trajectory
from identification.floor import by_phase, measure_floor, spread
from identification.validation import (
    autocorrelation,
    input_correlation,
    simulate_like,
    validate,
    whiteness_test,
)
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, T, data_set, run


def test_the_true_model_reaches_the_floor():
    data = data_set(force=0.0)
    result = validate(Drive(RIG), data)
    # what remains is the encoder: a raw difference of counts has a variance of q²/6 per Ts²
    assert result.rms < 1.2 * 4.6592 / np.sqrt(6)
    assert all(f.vaf > 0.99 for f in result.fits() if "0.5Hz" in f.recording)


def test_nrmse_and_vaf_by_definition():
    measured = run(Drive(RIG), "square", 2.0, 0.5)
    wrong = Drive(RIG).replace(b1=1.3 * RIG["b1"])
    fit = validate(wrong, [measured]).fits()[0]
    simulated = simulate_like(wrong, measured).v1
    e = measured.v1 - simulated
    assert fit.rms == pytest.approx(np.sqrt(np.mean(e**2)))
    assert fit.vaf == pytest.approx(1 - np.var(e) / np.var(measured.v1))
    assert fit.nrmse == pytest.approx(1 - np.linalg.norm(e) / np.linalg.norm(measured.v1 - measured.v1.mean()))


def test_white_noise_is_white_and_a_slow_wave_is_not():
    rng = np.random.default_rng(1)
    white = rng.normal(size=2000)
    assert whiteness_test(white)[0] > 0.01
    assert whiteness_test(np.convolve(white, np.ones(10), "same"))[0] < 1e-6


def test_autocorrelation_of_a_moving_average():
    e = np.convolve(np.random.default_rng(2).normal(size=200000), [1.0, 1.0], "valid")
    assert autocorrelation(e, 2) == pytest.approx([0.5, 0.0], abs=0.02)


def test_input_correlation_sees_what_the_command_still_explains():
    rng = np.random.default_rng(3)
    u, noise = rng.normal(size=4000), rng.normal(size=4000)
    assert input_correlation(noise, u) < 1.5
    assert input_correlation(noise + 0.5 * np.roll(u, 5), u) > 3.0


def test_floor_is_the_noise_of_a_periodic_signal():
    rng = np.random.default_rng(4)
    t = np.arange(8000) * 1e-3
    signal = np.sin(2 * np.pi * 2.0 * t) + 0.3 * rng.normal(size=8000)
    assert spread(by_phase(signal, 500.0))[0] == pytest.approx(0.09, rel=0.05)


def test_replicates_raise_the_floor_when_friction_changes_between_runs():
    t = np.arange(8001) * 1e-3
    rigs = [Drive({**RIG, **COUNTS, "d1": d}) for d in (0.3, 0.36, 0.42)]
    runs = [run(rig, "square", 2.0, 0.5, t=t, name=f"run {i}") for i, rig in enumerate(rigs)]
    together = measure_floor(runs)[0]
    alone = measure_floor(runs[:1])[0]
    assert together.source == "replicates"
    assert together.rms > 1.5 * alone.rms


def test_closed_loop_runs_are_simulated_in_the_loop():
    rig = Drive({**RIG, **COUNTS, "saturation.limit": 8.0})
    made = rig.simulate_closed_loop(T, handout_trajectory(T), PControl(0.1, "x2"), name="p")
    measured = replace(made, v1=None, v2=None, excitation=Excitation("closed_loop", 25.0, 0.5, "x2", 0.1))
    result = validate(rig, [measured])
    assert all(f.rms < 1e-9 for f in result.fits())
    # with the wrong friction a replay of u would drift away; the loop keeps x2 near
    off = validate(rig.replace(d1=1.3 * RIG["d1"]), [measured])
    assert {f.channel: f.rms for f in off.fits()}["x2"] < 3.0


def test_constant_channels_have_no_fit():
    still = run(Drive(RIG), "sine", 0.2, 1.0)
    fit = validate(Drive(RIG), [still]).fits()[0]
    assert np.isnan(fit.nrmse)
    assert fit.rms == 0.0


def test_an_unknown_controller_is_replayed_over_short_windows():
    rig = Drive({**RIG, **COUNTS, "saturation.limit": 8.0})
    made = rig.simulate_closed_loop(T, handout_trajectory(T), PControl(0.1, "x2"), name="somebody's")
    # the encoders were not zeroed, and the drive has more friction than the model knows
    measured = replace(
        made, x1=made.x1 + 40.0, x2=made.x2 - 3.0, v1=None, v2=None, excitation=Excitation("closed_loop", 25.0, 0.5)
    )
    result = validate(Drive(RIG), [measured])
    assert {f.channel for f in result.fits()} == {"x1", "x2"}
    assert all(f.rms < 0.1 for f in result.fits())
    assert all(f.how.startswith("windows of 0.3") for f in result.fits())
    assert "each begun in the measured state" in result.notes[0]
    assert "nan" not in str(result)
    assert "no velocity was recorded in open loop" in result.summary()
    wrong = validate(Drive({**RIG, "k": 0.5 * RIG["k"]}), [measured])
    assert all(w.rms > 3.0 * f.rms for w, f in zip(wrong.fits(), result.fits(), strict=True))


def test_positions_alone_are_compared_as_positions():
    made = Drive({**RIG, **COUNTS}).simulate(T, 2.0 * np.sign(np.sin(np.pi * T + 1e-9)))
    measured = replace(made, x1=made.x1 + 7.0, v1=None, v2=None, excitation=Excitation("square", 2.0, 0.5))
    fits = validate(Drive(RIG), [measured]).fits()
    assert [f.channel for f in fits] == ["x1", "x2"]
    assert all(f.rms < 0.1 for f in fits)


def test_a_spring_to_the_frame_holds_a_simulated_cart_near_its_place():
    spring = {**RIG, "ground_spring.kg": 0.04, "d1": 0.06, "d2": 0.01}
    made = Drive({**spring, **COUNTS}).simulate(T, 1.0 * np.sign(np.sin(np.pi * T + 1e-9)))
    measured = replace(made, v1=None, v2=None, excitation=Excitation("square", 1.0, 0.5))
    off = Drive({**spring, "d1": 0.09})
    free = off.simulate(T, measured.u)
    fits = {f.channel: f.rms for f in validate(off, [measured]).fits()}
    for name, rms in fits.items():
        expected = float(np.sqrt(np.mean((getattr(free, name) - getattr(measured, name)) ** 2)))
        assert rms == pytest.approx(expected, rel=0.02)


def test_a_held_cart_is_left_out_of_validation():
    data = data_set(force=0.0)[:2]
    result = validate(Drive(RIG), [data[0], replace(data[1], held=(2,))])
    assert len(result.overlays) == 1
    assert "held cart left out" in result.notes[0]
