"""Settings to motion, without a page."""

from base64 import b64decode

import numpy as np
import pytest

from baselines.lab_page.motion import controller_of, pushed, rig_of, simulate
from baselines.lab_page.settings import Push, Settings, from_query
from flexdrive_gym import DEFAULT_DRIVE, LinearController, PControl
from flexdrive_gym.references import handout_trajectory
from flexdrive_gym.units import Units
from tests.each import each


def test_p_control_is_the_drives_own_closed_loop():
    settings = Settings(gain=0.08)
    motion = simulate(settings, DEFAULT_DRIVE, controller_of(settings, DEFAULT_DRIVE))
    run = DEFAULT_DRIVE.simulate_closed_loop(motion.t, handout_trajectory(motion.t), PControl(0.08, "x2"))
    np.testing.assert_allclose(motion.x2, run.x2, atol=1e-9)
    np.testing.assert_allclose(motion.u, run.u, atol=1e-9)


def test_a_blow_of_no_size_changes_nothing_and_a_blow_gives_the_cart_its_speed():
    settings = Settings(gain=0.05, pushes=(Push(2, 1.0, 0.0),))
    without = simulate(settings.replace(pushes=()), DEFAULT_DRIVE, controller_of(settings, DEFAULT_DRIVE))
    still = simulate(settings, DEFAULT_DRIVE, controller_of(settings, DEFAULT_DRIVE))
    np.testing.assert_allclose(still.x2, without.x2, atol=1e-6)
    struck = simulate(
        settings.replace(pushes=(Push(2, 1.0, 200.0),)), DEFAULT_DRIVE, controller_of(settings, DEFAULT_DRIVE)
    )
    np.testing.assert_array_equal(struck.x2[:1001], still.x2[:1001])
    gained = (struck.x2 - still.x2)[1001:1004] / 1e-3
    assert gained[0] == pytest.approx(200.0, rel=0.05)  # less what friction and spring take within a sample


def test_a_blow_moves_the_centre_of_mass_by_its_momentum_where_nothing_brakes():
    free = DEFAULT_DRIVE.replace({"b1": 0.0, "b2": 0.0, "d1": 0.0, "d2": 0.0})
    t = np.arange(2001) * 1e-3
    x1, x2, _u = pushed(free, t, np.zeros_like(t), PControl(0.0), (Push(1, 0.5, 100.0),))
    m1, m2 = free["m1"], free["m2"]
    centre = (m1 * x1 + m2 * x2) / (m1 + m2)
    assert centre[-1] == pytest.approx(m1 * 100.0 / (m1 + m2) * 1.5, rel=2e-3)


def test_a_run_ends_where_a_cart_leaves_the_track():
    settings = Settings(controller="square", amplitude=8.0, frequency=0.05)
    motion = simulate(settings, DEFAULT_DRIVE, None)
    assert motion.stopped is not None
    assert np.abs(motion.x1).max() <= 401.0


def test_limit_delay_and_counts_reach_the_drive():
    rig = rig_of(Settings(limit=2.0, delay=0.004, count=0.1, effects={"stribeck.cart_1.extra": 0.1}), DEFAULT_DRIVE)
    assert (rig.voltage_limit, rig["input_delay.tau"]) == (2.0, 0.004)
    assert rig["encoder_quantisation.encoder_2.quantum"] == 0.1


def test_a_slower_controller_holds_its_command():
    settings = Settings(gain=0.1, sample_time=0.02)
    controller = controller_of(settings, DEFAULT_DRIVE)
    assert isinstance(controller, LinearController)
    u = simulate(settings, DEFAULT_DRIVE, controller).u
    assert np.count_nonzero(np.diff(u)) <= len(u) / 20 + 1


def test_the_address_holds_the_settings():
    settings = Settings(
        drive="rig2022", controller="lab4", factor=1.5, feedback="x1", limit=4.0, delay=0.002,
        effects={"coupling_backlash.g": 0.5}, pushes=(Push(2, 1.25, -80.0),),
    )  # fmt: skip
    from urllib.parse import parse_qsl

    again, refused = from_query(parse_qsl(settings.query()))
    assert (again, refused) == (settings, [])


@each(
    ("pair", "words"),
    [
        (("gain", "nan"), "gain: must lie in [0.005, 10]; got nan"),
        (("gain", "1e9"), "got 1e+09"),
        (("delay", "9"), "delay: must lie in"),
        (("effect", "no_such.thing:1"), "no parameter is called 'no_such.thing'"),
        (("push", "3:1:1"), "cart must be 1 or 2"),
        (("feedback", "x3"), "feedback: must be among x1, x2"),
        (("sample_time", "0.0007"), "sample_time: must be among"),
    ],
)
def test_what_the_address_asks_wrongly_is_refused_with_a_sentence(pair, words):
    settings, refused = from_query([pair])
    assert settings == Settings()
    assert words in refused[0]


def test_an_effect_too_fast_for_a_live_page_is_refused():
    with pytest.raises(ValueError, match="at most 40 steps a millisecond"):
        rig_of(Settings(effects={"motor_gear_backlash.mass": 1e-8, "motor_gear_backlash.kc": 1e3}), DEFAULT_DRIVE)


def test_a_rig_in_other_units_is_shown_in_its_own():
    units = Units("rad", "N m", per_length=100.0, per_command=10.0, per_time=2.0)
    drive = DEFAULT_DRIVE.replace(units=units)
    settings = Settings(gain=0.08)
    motion = simulate(settings, drive, controller_of(settings, drive))
    shown = motion.payload()
    assert (shown["length"], shown["command"], shown["step"]) == ("rad", "N m", 0.002)
    x1 = np.frombuffer(b64decode(shown["x1"]), dtype="<f4")
    np.testing.assert_allclose(x1, motion.x1[::4] / 100.0, atol=1e-6)


def test_unknown_controllers_are_refused():
    with pytest.raises(ValueError, match="no_such"):
        controller_of(Settings(controller="no_such"), DEFAULT_DRIVE)
    with pytest.raises(ValueError, match="no agent is called"):
        controller_of(Settings(controller="agent:../../etc"), DEFAULT_DRIVE)
