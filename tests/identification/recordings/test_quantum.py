import numpy as np
import pytest

from identification.recordings.quantum import encoder_quantum, velocity_cutoff
from identification.recordings.recognise import encoder_quantum as advertised
from tests.each import each
from tests.identification.recordings.logs import COUNT, TS, open_loop, speed, time

T, _, X1, X2 = open_loop()


def counts(x, count):
    return np.round(x / count) * count


def test_is_part_of_recognition():
    assert advertised is encoder_quantum


@each("decimals", [4, 6, 12])
def test_position_of_the_rig(decimals):
    assert encoder_quantum(np.round(X1, decimals)) == pytest.approx(COUNT, rel=1e-5)


@each("digits", [6, 7, 9])
def test_files_that_keep_digits_instead_of_decimals(digits):
    rounded = np.array([float(f"{x:.{digits}g}") for x in X1])
    assert encoder_quantum(rounded) == pytest.approx(COUNT, rel=1e-4)


def test_velocity_of_the_rig():
    assert encoder_quantum(np.round(speed(X2), 4)) == pytest.approx(COUNT / TS, rel=1e-6)


@each("count", [0.01, 0.005, 0.00125, 0.0254])
def test_other_encoders(count):
    x = np.round(counts(30.0 * np.sin(2.3 * time(4.0)), count), 5)
    assert encoder_quantum(x) == pytest.approx(count, rel=1e-4)


def test_a_position_that_does_not_start_at_zero():
    assert encoder_quantum(np.round(X1 + 123.4567, 4)) == pytest.approx(COUNT, rel=1e-4)


def test_a_few_corrupt_samples_do_not_hide_the_count():
    x = np.round(X1, 4)
    x[500:2500:500] += 0.0021
    assert encoder_quantum(x) == pytest.approx(COUNT, rel=1e-4)


def test_missing_values_are_ignored():
    x = np.round(X1, 4)
    x[::9] = np.nan
    assert encoder_quantum(x) == pytest.approx(COUNT, rel=1e-4)


@each("decimals", [3, 4, 6, None])
def test_simulated_positions_have_none(decimals):
    x = 30.0 * np.sin(2.3 * time(4.0))
    assert encoder_quantum(x if decimals is None else np.round(x, decimals)) == 0.0


def test_noise_has_none():
    assert encoder_quantum(np.random.default_rng(3).normal(size=4000)) == 0.0


@each("values", [np.zeros(100), np.full(100, np.nan), np.array([0.0, 1.0, 3.0])])
def test_a_channel_that_tells_nothing_has_none(values):
    assert encoder_quantum(values) == 0.0


@each("cutoff", [2.0, 20.0, 100.0])
def test_cutoff_of_a_filtered_derivative(cutoff):
    # v = wc (x - lowpass x), stepped with backward differences
    a = np.exp(-2.0 * np.pi * cutoff * TS)
    d, v = speed(X1), np.zeros(T.size)
    for n in range(1, T.size):
        v[n] = a * v[n - 1] + (1.0 - a) * d[n]
    assert velocity_cutoff(np.round(X1, 4), np.round(v, 4), TS) == pytest.approx(cutoff, rel=1e-3)


def test_raw_difference_has_cutoff_zero():
    assert velocity_cutoff(np.round(X1, 4), np.round(speed(X1), 4), TS) == 0.0


def test_a_simulated_velocity_counts_as_raw():
    x = 30.0 * np.sin(6.0 * T)
    assert velocity_cutoff(x, 180.0 * np.cos(6.0 * T), TS) == 0.0


@each("v", [np.zeros(T.size), 40.0 * np.sin(9.0 * T)], ids=["standing", "unrelated"])
def test_a_velocity_that_the_position_does_not_explain_has_none(v):
    assert velocity_cutoff(X1, v, TS) is None
