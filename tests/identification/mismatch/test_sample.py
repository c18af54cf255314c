"""The bundled sample, which every reader diagnoses first: what it lacks is named, and the simulation is better for it."""

import pytest

from baselines.lab.sample import FOLDER
from baselines.lab.sample.make import RIG
from identification.mismatch.diagnose import diagnose


@pytest.mark.slow
def test_the_sample_lacks_stribeck_friction_and_is_simulated_better_with_it():
    found = diagnose(FOLDER)
    assert ("stribeck", "cart_1") in {(f.id, f.where) for f in found.findings}
    assert found.after_rms < 0.95 * found.before_rms
    for name in ("m1", "m2", "b1", "k"):
        assert found.drive[name] == pytest.approx(RIG[name], rel=0.05)
