"""What encoders report: play, scale, eccentricity, delay, lost sign; and replays anchored to a measured track."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.sample import WORK_SPACE
from tests.drive.drives import RIG
from tests.drive.effects.runs import H, instants
from tests.each import each

T = instants(2.0)
U = 2.0 * np.where(T % 0.8 < 0.4, 1.0, -1.0) + 0.5 * np.sin(2 * np.pi * 5 * T)


def replay(values, u, *, track=None, start=(0.0, 0.0, 0.0, 0.0)):
    """Readings x1, x2, v1, v2 and true x1, v1, x2, v2."""
    readings, states = np.empty((4, len(u))), np.empty((4, len(u)))
    kernels.run_open_loop(
        u, H, parameters.substeps(values, H, H), np.array(start), np.zeros(WORK_SPACE), parameters.workspace(values),
        parameters.vector(values), readings, states, track,
    )  # fmt: skip
    return readings, states


SENSORS = [
    {"encoder_play.encoder_1.g": 0.3, "encoder_play.encoder_2.g": 0.2},
    {"encoder_scale.s": 0.02},
    {"encoder_eccentricity.a_sin": 0.3, "encoder_eccentricity.P": 15.0},
    {"encoder_delay.encoder_1.tau": 0.0024},
    {"rectified_sensor.encoder_1.share": 1.0},
    {"rectified_sensor.encoder_1.share": 1.0, "rectified_sensor.encoder_1.e": 0.2},
]


@each("values", SENSORS)
def test_sensors_do_not_touch_the_physics(values):
    assert np.allclose(replay({**RIG, **values}, U)[1], replay(RIG, U)[1], atol=1e-9)


def test_play_is_the_play_operator():
    g = 0.3
    readings, states = replay({**RIG, "encoder_play.encoder_1.g": g}, U)
    y = [0.0]
    for x in states[0, 1:]:
        y.append(min(max(y[-1], x - g), x + g))
    assert np.array_equal(readings[0], y)
    assert np.array_equal(readings[1], states[2])
    # after the reversal the reading is frozen while the cart goes 2g
    turn = int(np.argmax(states[0]))
    frozen = np.flatnonzero(readings[0, turn:] != readings[0, turn])[0]
    assert states[0, turn] - states[0, turn + frozen - 1] <= 2 * g <= states[0, turn] - states[0, turn + frozen]


def test_scale_and_eccentricity_in_the_documented_order():
    values = {
        **RIG, "encoder_scale.s": 0.02, "encoder_eccentricity.a_sin": 0.3, "encoder_eccentricity.a_cos": -0.1,
        "encoder_eccentricity.P": 15.0, "encoder_quantisation.encoder_2.quantum": 0.01,
    }  # fmt: skip
    readings, states = replay(values, U)
    phase = 2 * np.pi * states[2] / 15.0
    ideal = 1.02 * states[2] + 0.3 * np.sin(phase) - 0.1 * np.cos(phase)
    assert np.abs(readings[1] - ideal).max() <= 0.005 * (1 + 1e-9)
    assert np.allclose(readings[1] / 0.01, np.rint(readings[1] / 0.01), atol=1e-6)


@each("tau", [0.4e-3, 2e-3, 3.7e-3])
def test_a_late_channel_reads_the_past(tau):
    readings, states = replay({**RIG, "encoder_delay.encoder_2.tau": tau}, U)
    late = np.interp(T - tau, T, states[2], left=0.0)
    assert np.abs(readings[1] - late).max() < 1e-9
    assert np.array_equal(readings[0], states[0])
    # the velocity made from it is late too
    assert np.allclose(readings[3, 1:], np.diff(late) / H, atol=1e-6)


def test_a_late_channel_of_a_run_that_starts_in_motion():
    tau, v = 0.0025, 120.0
    readings, _states = replay({**RIG, "encoder_delay.encoder_1.tau": tau}, U, start=(0.0, v, 0.0, v))
    assert readings[0, 0] == pytest.approx(-v * tau)
    assert np.abs(np.diff(readings[2, :3])).max() < 5.0  # no jump of the velocity


def test_pulse_counters_lose_the_sign():
    cutoff = {"velocity_processing.encoder_1.cutoff": 60.0}
    plain, _states = replay(RIG, U)
    counted, _states = replay({**RIG, "rectified_sensor.encoder_1.share": 1.0}, U)
    assert np.allclose(counted[2], np.abs(plain[2]), atol=1e-6)
    assert np.allclose(counted[0], plain[0], atol=1e-9)
    assert np.allclose(counted[3], plain[3], atol=1e-6)
    # what is filtered is the counted rate
    filtered, _states = replay({**RIG, **cutoff, "rectified_sensor.encoder_1.share": 1.0}, U)
    a = np.exp(-2 * np.pi * 60.0 * H)
    expected = [0.0]
    for rate in np.abs(plain[2, 1:]):
        expected.append(a * expected[-1] + (1 - a) * rate)
    assert np.allclose(filtered[2], expected, atol=1e-6)


def test_a_bent_counter_shows_a_power_of_the_speed():
    plain, _states = replay(RIG, U)
    bent, _states = replay({**RIG, "rectified_sensor.encoder_1.share": 1.0, "rectified_sensor.encoder_1.e": 0.2}, U)
    assert np.allclose(bent[2], 100.0 * (np.abs(plain[2]) / 100.0) ** 1.2, atol=1e-5)
    assert np.allclose(bent[3], plain[3], atol=1e-6)


def test_a_drive_started_again_has_forgotten():
    drive = Drive({**RIG, **SENSORS[0], **SENSORS[3], "presliding.cart_1.fd": 0.2})
    assert np.array_equal(drive.simulate(T, U).v1, drive.simulate(T, U).v1)


COGGING = {"cogging.a_sin": 0.2, "cogging.P": 12.0}


def test_a_replay_on_its_own_track_changes_nothing():
    values = {**RIG, **COGGING, "position_friction.cart_2.a_sin": 0.1, "ground_spring.kg": 1e-3}
    free, states = replay(values, U)
    tracked, _states = replay(values, U, track=np.ascontiguousarray(states[[0, 2]]))
    assert np.allclose(free, tracked, atol=1e-6)


def test_a_replay_that_started_elsewhere_is_put_in_phase_by_its_track():
    # the rig started 3.5 mm along the track; a replay from zero has the same velocities once it is told where the rig was
    rig, states = replay({**RIG, **COGGING}, U, start=(3.5, 0.0, 3.5, 0.0))
    track = np.ascontiguousarray(states[[0, 2]])
    told, _s = replay({**RIG, **COGGING}, U, track=track)
    lost, _s = replay({**RIG, **COGGING}, U)
    assert np.abs(told[2] - rig[2]).max() < 1e-6
    assert np.abs(lost[2] - rig[2]).max() > 5.0
    assert np.allclose(told[0], rig[0] - 3.5, atol=1e-6)  # the carts themselves stay in the run's frame


def test_a_gap_in_the_track_keeps_the_anchor():
    _rig, states = replay({**RIG, **COGGING}, U, start=(3.5, 0.0, 3.5, 0.0))
    track = np.ascontiguousarray(states[[0, 2]])
    whole, _s = replay({**RIG, **COGGING}, U, track=track)
    track[:, 300:500] = np.nan
    assert np.allclose(whole, replay({**RIG, **COGGING}, U, track=track)[0], atol=1e-6)


def test_eccentricity_follows_the_track():
    values = {**RIG, "encoder_eccentricity.a_sin": 0.3, "encoder_eccentricity.P": 15.0}
    _rig, states = replay(RIG, U)
    track = np.ascontiguousarray(states[[0, 2]] + 4.0)
    readings, states = replay(values, U, track=track)
    assert np.allclose(readings[1], states[2] + 0.3 * np.sin(2 * np.pi * (states[2] + 4.0) / 15.0), atol=1e-6)


def test_bristles_do_not_feel_the_anchor():
    values = {**RIG, "presliding.cart_1.fd": 0.2, "presliding.cart_1.xs": 0.3}
    free, states = replay(values, U)
    track = np.ascontiguousarray(states[[0, 2]] + np.cumsum(np.full(len(U), 0.05)))
    assert np.allclose(free, replay(values, U, track=track)[0], atol=1e-9)
