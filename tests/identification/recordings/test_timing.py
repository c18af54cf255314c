import numpy as np
import pytest

from identification.recordings import RecordingError
from identification.recordings.timing import make_uniform, spans
from tests.each import each
from tests.identification.recordings.logs import square, time


def uniform(t, **signals):
    return make_uniform(t, signals, "log.csv")


def test_uniform_stamps_are_left_alone():
    t = time(1.0)
    result = uniform(t, u=square(t), x1=np.sin(t))
    assert result.notes == ()
    assert result.missing == {}
    np.testing.assert_array_equal(result.t, t)
    np.testing.assert_array_equal(result.signals["x1"], np.sin(t))


def test_jitter_is_noted_and_resampled_and_the_command_stays_two_valued():
    t = time(1.0)
    stamps = t + 0.2e-3 * np.sin(40.0 * np.arange(t.size))
    result = uniform(stamps, u=square(stamps, 2.0, 3.0), x1=5.0 * stamps)
    assert "jitter of up to" in result.notes[0]
    assert np.ptp(np.diff(result.t)) < 1e-9
    np.testing.assert_allclose(result.signals["x1"], 5.0 * result.t, atol=1e-9)
    assert set(result.signals["u"]) == {-2.0, 2.0}


def test_jitter_below_five_percent_is_none():
    t = time(1.0) + 0.02e-3 * np.sin(40.0 * np.arange(1001))
    assert uniform(t, u=square(t)).notes == ()


def test_rounded_stamps_are_straightened_without_touching_the_signals():
    exact = np.arange(600) / 600.0
    x = np.sin(exact)
    result = uniform(np.round(exact, 3), u=square(exact), x1=x)
    assert "rounded to 0.001 s" in result.notes[0]
    np.testing.assert_array_equal(result.signals["x1"], x)
    np.testing.assert_allclose(np.diff(result.t), 1.0 / 600.0, rtol=1e-3)


def test_a_gap_is_bridged_masked_and_noted():
    t = time(1.0)
    keep = (t < 0.3005) | (t > 0.3205)
    result = uniform(t[keep], u=square(t)[keep], x1=t[keep])
    assert "gaps in time, bridged and masked: 0.021 s at 0.3 s" in result.notes[0]
    np.testing.assert_allclose(result.t, t, atol=1e-9)
    np.testing.assert_allclose(result.signals["x1"], t, atol=1e-9)
    np.testing.assert_allclose(result.missing[""], [(0.301, 0.320)], atol=1e-9)


def test_the_longest_piece_between_long_gaps_is_read():
    t = time(3.0)
    keep = (t < 0.5) | (t > 1.1)
    result = uniform(t[keep], u=square(t)[keep])
    assert "gaps of 0.602 s in time: of 2 pieces the longest is read, samples 501 to 2400" in result.notes[0]
    np.testing.assert_allclose(result.t, t[t > 1.1])


def test_many_short_gaps_of_more_than_half_a_second_are_refused():
    t = time(3.0)
    keep = np.arange(t.size) % 12 < 9
    with pytest.raises(RecordingError, match="time: gaps may add up to 0.5 s; got 0.7"):
        uniform(t[keep], u=square(t)[keep])


def test_a_few_missing_values_are_interpolated_and_reported_per_signal():
    t = time(1.0)
    x, u = 3.0 * t, square(t, 2.0, 2.0)
    x[100:103], x[500], u[250] = np.nan, np.nan, np.nan
    result = uniform(t, u=u, x1=x)
    np.testing.assert_allclose(result.signals["x1"], 3.0 * t)
    np.testing.assert_allclose(result.missing["x1"], [(0.100, 0.102), (0.5, 0.5)])
    np.testing.assert_allclose(result.missing["u"], [(0.25, 0.25)])
    assert result.signals["u"][250] == result.signals["u"][249]  # held, not averaged


def test_many_missing_values_are_refused():
    t = time(1.0)
    x = np.where(np.arange(t.size) % 4 == 0, np.nan, t)
    with pytest.raises(RecordingError, match="column x1: at most 20% of the values may be missing; got 25%"):
        uniform(t, u=square(t), x1=x)


def test_repeated_stamps_are_dropped():
    t = np.insert(time(1.0), [200, 700], [0.2, 0.7])
    result = uniform(t, u=square(t))
    assert result.notes == ("2 samples with a repeated time stamp dropped",)
    np.testing.assert_allclose(result.t, time(1.0))


def test_stamps_with_too_few_decimals_are_refused():
    with pytest.raises(RecordingError, match="stamps must differ .* Export the time with more decimals"):
        uniform(np.round(time(1.0), 2), u=square(time(1.0)))


def test_of_a_clock_that_starts_again_the_longest_piece_is_read():
    t = time(1.0)
    twice = np.r_[t[:601], t]
    result = uniform(twice, u=square(twice), x1=np.r_[0.0 * t[:601], t])
    assert result.notes == ("the clock starts again: of 2 pieces the longest is read, samples 602 to 1602",)
    np.testing.assert_array_equal(result.signals["x1"], t)


def test_samples_that_come_late_are_sorted():
    t = time(1.0)
    order = np.arange(t.size)
    order[[400, 401]] = 401, 400
    result = uniform(t[order], u=square(t)[order], x1=t[order])
    assert result.notes == ("1 samples out of order, sorted by time",)
    np.testing.assert_array_equal(result.signals["x1"], t)


def test_time_that_runs_to_and_fro_is_refused():
    t = np.sin(20.0 * time(4.0))
    with pytest.raises(RecordingError, match="time: must increase; got .* steps backwards in all. Sort"):
        uniform(t, u=square(t))


def test_stamps_rounded_to_a_millisecond_at_another_period():
    exact = 0.0011272 * np.arange(1, 4001)
    result = uniform(np.round(exact, 3), u=square(exact), x1=exact)
    assert "time stamps rounded to 0.001 s, uniform at 0.001127" in result.notes[0]
    np.testing.assert_allclose(np.diff(result.t), 0.0011272, rtol=2e-4)
    np.testing.assert_array_equal(result.signals["x1"], exact)
    assert result.missing == {}


def test_a_lost_sample_is_no_rounding():
    t = np.delete(time(1.0), 500)
    result = uniform(t, u=square(t))
    assert "gaps in time" in result.notes[0]
    np.testing.assert_allclose(result.missing[""], [(0.5, 0.5)], atol=1e-9)


def test_a_given_sampling_period_holds_instead_of_the_stamps():
    t = time(1.0)
    assert make_uniform(t, {"u": square(t)}, "a", 1.002e-3).notes == ()
    result = make_uniform(t, {"u": square(t)}, "a", 1.05e-3)
    assert result.notes == ("the sampling period is 0.00105 s by rig.toml, 0.001 s by the time stamps",)
    np.testing.assert_allclose(np.diff(result.t), 1.05e-3)
    assert make_uniform(t, {"u": square(t)}, "a", 0.1).notes[0].startswith("warning: ")


def test_stamps_that_would_be_interpolated_for_the_most_part_are_refused():
    t = np.r_[time(0.04), 0.45 + time(0.04)]
    with pytest.raises(RecordingError, match="time: most samples must have been recorded, not interpolated; got 82"):
        uniform(t, u=square(t))


def test_samples_without_a_stamp_are_dropped():
    t = time(1.0)
    t[10] = np.nan
    result = uniform(t, u=square(time(1.0)))
    assert result.notes[0] == "1 samples without a time stamp dropped"
    np.testing.assert_allclose(result.t, time(1.0), atol=1e-12)


def test_time_without_stamps_is_refused():
    t = np.full(400, np.nan)
    with pytest.raises(RecordingError, match="at most 20% of the stamps may be missing"):
        uniform(t, u=np.ones(400))


def test_milliseconds_labelled_seconds():
    t = 1e3 * time(1.0)
    with pytest.raises(RecordingError, match="time: the sampling period must be below 0.5 s; got 1 s.*t_ms"):
        uniform(t, u=square(t))


def test_seconds_labelled_milliseconds():
    t = 1e-3 * time(1.0)
    with pytest.raises(RecordingError, match="must last 0.2 s.*may be seconds although"):
        uniform(t, u=square(t))


@each("t", [time(0.15), np.arange(40) * 0.02, np.zeros(1)], ids=["0.15 s", "40 samples", "one sample"])
def test_too_short(t):
    with pytest.raises(RecordingError, match="a recording must last 0.2 s and 50 samples; got"):
        uniform(t, u=square(t))


def test_spans_name_first_and_last_instants():
    bad = np.array([True, False, True, True, False, True])
    assert spans(np.arange(6.0), bad) == [(0.0, 0.0), (2.0, 3.0), (5.0, 5.0)]
