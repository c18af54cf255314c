"""A diagnosis speaks the rig's units: every figure of it is the engine's, converted, with the unit beside it."""

import numpy as np
import pytest

from flexdrive_gym.units import Units
from identification.diagnosis.maps import Map
from identification.mismatch.verdict import Estimate, Prediction, RecordingFit

UNITS = Units("m", "mV", per_length=1000.0, per_command=1e-3)


def test_estimates_fits_and_predictions():
    assert str(Estimate(0.2, (0.1, 0.3), "V").of_rig(UNITS)) == "200 [100, 300] mV"
    fit = RecordingFit("a", 8.0, 4.0, 2.0, held_out=True).of_rig(UNITS)
    assert (fit.before_rms, fit.after_rms, fit.floor_rms, fit.unit) == pytest.approx((8e-3, 4e-3, 2e-3, "m/s"))
    seen = Prediction("critical gain", 0.2, None, "V/mm").of_rig(UNITS)
    assert seen.before == pytest.approx(0.2 * 1000.0 * 1000.0)
    assert (seen.after, seen.unit) == (None, "mV/m")


def test_a_map_says_where_in_the_rigs_units():
    m = Map("cart_1", "v1", np.array([-20.0, 20.0]), np.array([0.05, -0.1]), np.array([0.01, 0.01]), 0.5, 0.07)
    assert m.sentence.endswith("it is largest, -0.1 V, at v1 = 20 mm/s")
    assert m.of_rig(UNITS).sentence.endswith("it is largest, -100 mV, at v1 = 0.02 m/s")
