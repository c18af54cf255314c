"""The environments' drives go from event to event exactly: against integrations that share no code with them."""

import gymnasium
import numpy as np
import pytest

from benchmarks.accuracy import excitations
from flexdrive_gym import Drive
from flexdrive_gym.drive import forces, layout, parameters
from flexdrive_gym.drive.batch import series
from tests.drive.drives import RIG
from tests.drive.reference import TwoMasses
from tests.each import each

NAMES = tuple(excitations(np.zeros(1)))


def states(drive, u, period, **arguments):
    """True states [x1, v1, x2, v2] at the end of every control period under commands u [V]."""
    env = gymnasium.make(
        "FlexDrive-NonCollocated-v0", drive=drive, control_period=period, duration=(len(u) + 1) * period,
        travel_limit=1e5, stroke_limit=1e5, voltage_limit=10.0, **arguments,
    )  # fmt: skip
    env.reset(seed=0)
    found = []
    for value in u:
        info = env.step([value / 10.0])[4]
        found.append([info[name] for name in ("x1", "v1", "x2", "v2")])
    return np.array(found)


@each("name", NAMES)
@each("period", [1e-3, 5e-3, 2e-2])
def test_agrees_with_event_driven_integration_by_another_library(name, period):
    t = np.arange(round(2.0 / period) + 1) * period
    u = excitations(t)[name]
    expected = TwoMasses(**RIG).run(t, u)
    found = states(Drive(RIG), u[:-1], period)
    peak = np.abs(expected[[1, 3]]).max()
    assert np.abs(found.T - expected[:, 1:])[[1, 3]].max() <= 3e-8 * peak


def test_base_effects_are_linear_and_their_friction_is_constant_as_the_series_need():
    p = parameters.vector({**RIG, "C": 0.002})
    a, b = (np.array(state) for state in ((1.0, -30.0, 0.4, 12.0), (-2.0, 5.0, 3.0, -40.0)))

    def force(state, s=0.0):
        x1, v1, x2, v2 = state
        fs = forces.spring_force(x1 - x2, v1 - v2, None, 0, p)
        one, two = (
            forces.force_1(x1, v1, s, 0.0, fs, 0.7, None, None, 0, p),
            forces.force_2(x2, v2, s, fs, 0.7, None, None, 0, p),
        )
        return np.array([one, two])

    assert np.allclose(force(a + 2.0 * b), force(a) + 2.0 * force(b), rtol=1e-13)
    assert np.array_equal(force(a, 1.0), force(a, -1.0))
    assert np.array_equal(force(a, 1.0), force(a))
    levels = {
        forces.level_1(x, v, s, fs, t, None, None, 0, p) for x, v, s, fs, t in ((0, 1, 1, 0, 0), (9, -80, -1, 3, 2))
    }
    assert levels == {RIG["d1"]}


def test_what_units_do_says_what_any_state_does():
    p = parameters.vector({**RIG, "C": 0.002})
    h, (x1, v1, x2, v2, u) = 1e-3, (1.0, -30.0, 0.4, 12.0, 3.0)
    units = np.zeros(layout.RESPONSES)
    series.respond(h, p, units, 1)
    fs = forces.spring_force(x1 - x2, v1 - v2, None, 0, p)
    f1, f2 = (
        forces.force_1(x1, v1, 0.0, u, fs, 0.7, None, None, 0, p),
        forces.force_2(x2, v2, 0.0, fs, 0.7, None, None, 0, p),
    )
    assert units[:4] @ [v1, v2, x1 - x2, u] == pytest.approx(h * f1 / RIG["m1"], rel=1e-12)
    assert units[5:8] @ [v1, v2, x1 - x2] == pytest.approx(h * f2 / RIG["m2"], rel=1e-12)
    assert units[[4, 8]] == pytest.approx([h * RIG["d1"] / RIG["m1"], h * RIG["d2"] / RIG["m2"]], rel=1e-12)
