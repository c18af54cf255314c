"""The environments' drives go from event to event exactly: against integrations that share no code with them."""

import gymnasium
import numpy as np
import pytest

from benchmarks.accuracy import excitations
from flexdrive_gym import Drive
from tests.drive.drives import RIG
from tests.drive.reference import TwoMasses

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


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("period", [1e-3, 5e-3, 2e-2])
def test_agrees_with_event_driven_integration_by_another_library(name, period):
    t = np.arange(round(2.0 / period) + 1) * period
    u = excitations(t)[name]
    expected = TwoMasses(**RIG).run(t, u)
    found = states(Drive(RIG), u[:-1], period)
    peak = np.abs(expected[[1, 3]]).max()
    assert np.abs(found.T - expected[:, 1:])[[1, 3]].max() <= 3e-8 * peak
