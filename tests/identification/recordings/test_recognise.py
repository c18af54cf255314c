import numpy as np
import pytest

from identification.recordings import recognise_excitation
from identification.recordings.recognise import find_limit
from tests.each import each
from tests.identification.recordings.logs import closed_loop, open_loop, sine, square, time, trajectory

T = time(8.0)


def held(*parts):
    u = np.concatenate(parts)
    return np.arange(u.size) * 1e-3, u


class TestSquare:
    @each("sign", [1.0, -1.0])
    @each(("amplitude", "frequency"), [(1.5, 0.5), (0.8, 2.0), (3.0, 10.0), (2.0, 0.21)])
    def test_amplitude_and_frequency(self, amplitude, frequency, sign):
        found = recognise_excitation(T, sign * square(T, amplitude, frequency))
        assert found.kind == "square"
        assert found.amplitude == pytest.approx(amplitude)
        assert found.frequency == pytest.approx(frequency, rel=2e-3)

    def test_one_and_a_half_periods_suffice(self):
        t = time(3.0)
        assert recognise_excitation(t, square(t, 2.0, 0.5)).kind == "square"

    @each("before", [0.0, 0.7, -2.0])
    def test_a_constant_start_and_end(self, before):
        t, u = held(np.full(1234, before), square(T, 2.0, 0.5), np.zeros(700))
        found = recognise_excitation(t, u)
        assert (found.kind, found.amplitude) == ("square", 2.0)
        assert found.frequency == pytest.approx(0.5, rel=5e-3)

    def test_a_start_in_the_middle_of_a_half_period(self):
        t = time(6.3)
        assert recognise_excitation(t, square(t + 0.37, 2.0, 0.5)).frequency == pytest.approx(0.5, rel=1e-3)

    def test_a_sign_function_that_passes_zero(self):
        u = 2.0 * np.sign(np.sin(np.pi * T))
        assert recognise_excitation(T, u).kind == "square"

    def test_noise_on_the_plateaus(self):
        u = square(T) + 0.01 * np.random.default_rng(1).normal(size=T.size)
        assert recognise_excitation(T, u).amplitude == pytest.approx(2.0, rel=1e-3)


class TestSine:
    @each(("amplitude", "frequency"), [(2.5, 0.5), (2.0, 3.5), (2.5, 4.5), (2.5, 20.0), (0.3, 49.7), (1.0, 0.2)])
    def test_amplitude_and_frequency(self, amplitude, frequency):
        found = recognise_excitation(T, sine(T, amplitude, frequency))
        assert found.kind == "sine"
        assert found.amplitude == pytest.approx(amplitude, rel=1e-3)
        assert found.frequency == pytest.approx(frequency, rel=1e-3)

    def test_a_rest_before_and_after(self):
        t, u = held(np.zeros(2000), sine(time(4.0), 2.5, 3.0), np.zeros(1500))
        found = recognise_excitation(t, u)
        assert (found.kind, round(found.frequency, 2)) == ("sine", 3.0)

    def test_a_slow_sampling(self):
        t = np.arange(400) * 0.02
        assert recognise_excitation(t, sine(t, 1.0, 7.0)).frequency == pytest.approx(7.0, rel=1e-3)


@each(
    "u",
    [
        np.sign(np.random.default_rng(2).normal(size=80)).repeat(100)[: T.size],
        np.random.default_rng(2).normal(size=T.size),
        sine(T, 2.0, 1.0) + sine(T, 1.0, 3.3),
        np.clip(sine(T, 6.0, 1.0), -3.0, 3.0),
        2.0 + square(T, 2.0),
        np.where(T > 1.0, 2.0, 0.0),
        np.full(T.size, 1.5),
        sine(T, 2.0, 0.1),
    ],
    ids=["prbs", "noise", "two sines", "clipped", "one-sided", "step", "constant", "under a period"],
)
def test_anything_else_is_other(u):
    assert recognise_excitation(T[: u.size], u).kind == "other"


class TestClosedLoop:
    def test_gain_and_feedback(self):
        t, u, xr, x1, x2 = closed_loop(0.05)
        found = recognise_excitation(t, u, x1, x2, xr)
        assert (found.kind, found.feedback, found.limit) == ("closed_loop", "x2", None)
        assert found.gain == pytest.approx(0.05, rel=1e-6)

    def test_feedback_from_the_first_cart(self):
        t, _, xr, x1, x2 = closed_loop(0.05)
        found = recognise_excitation(t, 0.2 * (xr - x1), x1, x2, xr)
        assert (found.feedback, round(found.gain, 6)) == ("x1", 0.2)

    @each("late", ["position", "error"])
    def test_logs_that_are_one_step_late(self, late):
        t, _, xr, x1, x2 = closed_loop(0.05)
        before = np.r_[x2[0], x2[:-1]]
        u = 0.7 * (xr - before if late == "position" else np.r_[0.0, (xr - x2)[:-1]])
        found = recognise_excitation(t, u, x1, x2, xr)
        assert (found.feedback, round(found.gain, 6)) == ("x2", 0.7)

    def test_the_limit_that_the_command_rests_at(self):
        t, u, xr, x1, x2 = closed_loop(0.6)
        assert np.mean(np.abs(u) == 8.0) > 0.1  # this gain is unstable
        found = recognise_excitation(t, u, x1, x2, xr)
        assert found.limit == 8.0
        assert found.gain == pytest.approx(0.6, rel=1e-6)

    def test_the_reference_amplitude_and_repetition(self):
        t, u, xr, x1, x2 = closed_loop(0.05)
        found = recognise_excitation(t, u, x1, x2, xr)
        assert found.amplitude == pytest.approx(50.0, rel=1e-3)
        assert found.frequency == pytest.approx(0.5, rel=2e-3)

    def test_a_single_move_does_not_repeat(self):
        t = time(4.0)
        xr = np.minimum(trajectory(t), 50.0) * (t < 1.0) + 50.0 * (t >= 1.0)
        x = np.zeros(t.size)
        assert recognise_excitation(t, 0.05 * (xr - x), x, None, xr).frequency == 0.0

    def test_another_controller_has_no_gain(self):
        t, _, xr, x1, x2 = closed_loop(0.05)
        lead = 0.05 * (xr - x2) + 2.0 * np.sin(40.0 * t)
        found = recognise_excitation(t, lead, x1, x2, xr)
        assert (found.kind, found.feedback, found.gain) == ("closed_loop", None, None)

    def test_feedback_that_was_not_recorded_has_no_gain(self):
        t, u, xr, x1, _ = closed_loop(0.05)
        assert recognise_excitation(t, u, x1, None, xr).gain is None

    def test_regulation_to_a_fixed_reference(self):
        t, _, _, x1, x2 = closed_loop(0.05)
        found = recognise_excitation(t, 0.3 * (10.0 - x2), x1, x2, np.full(t.size, 10.0))
        assert (found.kind, found.feedback, found.frequency) == ("closed_loop", "x2", 0.0)

    def test_a_resting_reference_beside_an_open_loop_drive_is_an_unused_channel(self):
        t, u, x1, x2 = open_loop()
        assert recognise_excitation(t, u, x1, x2, np.zeros(t.size)).kind == "square"


def test_the_largest_command_met_in_passing_is_no_limit():
    limit, resting = find_limit(sine(T, 2.5, 0.9))
    assert limit is None
    assert not resting.any()


def test_a_silent_command_has_no_limit():
    assert find_limit(np.zeros(100))[0] is None
