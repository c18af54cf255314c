"""A refit finds what is there, and goes nowhere that cannot be simulated."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexdrive_gym.drive.parameters import fastest
from identification.mismatch import refit as module
from identification.mismatch.crew import Crew
from identification.mismatch.refit import Coordinates, refit, sensitivities
from identification.replay.output_error import PHYSICS_S
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import short_day, workbench

PLAY = {"motor_gear_backlash.mass": 1e-4, "motor_gear_backlash.gap": 0.1, "motor_gear_backlash.kc": 5.0}


@pytest.fixture(scope="module")
def bench():
    with Crew(2) as pool:
        made = workbench(short_day()[:2], pool)
        made.weigh(made.residual(RIG))
        yield made


def test_a_motor_that_is_not_there_is_not_followed_to_nothing(bench, monkeypatch):
    # its rate grows beyond all bounds as its mass vanishes
    begin = fastest(PLAY)[0] * PHYSICS_S
    monkeypatch.setattr(module, "_FINEST", 1.5 * begin)
    found = refit(bench, {**RIG, **PLAY}, (*RIG, *PLAY), iterations=4)
    assert fastest(found.values)[0] * PHYSICS_S <= 1.5 * begin


def test_a_wrong_mass_is_put_right(bench):
    found = refit(bench, {**RIG, "m2": 1.3 * RIG["m2"]}, ("m2",))
    assert found.values["m2"] == pytest.approx(RIG["m2"], rel=0.02)


def test_what_holds_a_cart_has_a_slope_beyond_a_plateau():
    """A command that jumps releases a cart at any level between two of its values; a small step sees nothing of that."""

    def residuals(drives):
        return np.column_stack([np.full(3, np.floor(50.0 * d["breakaway.cart_1.extra"])) for d in drives])

    values = {**RIG, "breakaway.cart_1.extra": 0.405}
    c = Coordinates(["breakaway.cart_1.extra"], values)
    here = residuals([values])[:, 0]
    assert sensitivities(SimpleNamespace(residuals=residuals), c, c.of(values), values, here).all()
