"""A wavelength along the track shows, wherever every run began."""

import numpy as np
import pytest

from identification.diagnosis.missing_force import MissingForce
from identification.mismatch.spatial import peaks, periods, spectra

PERIOD = 12.7


def runs(along_friction):
    rng = np.random.default_rng(0)
    made = []
    for r in range(6):
        t = np.arange(2000) * 4e-3
        x = 40.0 * np.sin(2 * np.pi * (0.4 + 0.1 * r) * t)
        v = np.gradient(x, t)
        wave = 0.05 * np.sin(2 * np.pi * (x + rng.uniform(0, PERIOD)) / PERIOD)
        g = np.vstack([-np.sign(v) * wave if along_friction else wave, np.zeros(2000)]) + 0.02 * rng.normal(
            size=(2, 2000)
        )
        both = np.vstack([x, x]), np.vstack([v, v])
        made.append(MissingForce(str(r), t, t, *both, g, g, np.ones((2, 2000), dtype=bool)))
    return made


@pytest.mark.parametrize("along_friction", [False, True])
def test_a_known_period_is_found(along_friction):
    power = spectra(runs(along_friction), 0)[int(along_friction)]
    assert peaks(power, 1)[0] == pytest.approx(PERIOD, rel=0.02)


def test_start_values_are_offered_to_the_catalogue():
    found = periods(runs(along_friction=False))
    assert min(abs(P / PERIOD - 1.0) for P in found["cogging.P"]) < 0.02
