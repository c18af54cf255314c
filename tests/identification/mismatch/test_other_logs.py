"""The diagnosis takes logs that are not open-loop runs with two velocities."""

from dataclasses import replace

import numpy as np
import pytest

from identification import diagnose, read_recordings
from tests.baselines.public_data.stand_ins import CARRIAGE, write_carriage
from tests.identification.mismatch.lab import KINDS, QUICK, T, data_set

pytestmark = pytest.mark.slow


def test_one_cart_in_closed_loop_with_positions_only(tmp_path):
    write_carriage(tmp_path / "log.csv", 18.0, seed=1)
    (log,) = read_recordings(tmp_path / "log.csv")
    assert log.closed_loop
    found = diagnose(tmp_path, settings=QUICK)
    assert found.split.blocks
    assert any("blocks are parts of one recording" in note for note in found.notes)
    # blocks of one recording share whatever is constant, so a constant force may be taken for run-to-run variability
    assert {f.id for f in found.findings} <= {"input_offset", "tilt", "coulomb_asymmetry"}
    for name in ("m1", "b1"):
        assert found.drive[name] == pytest.approx(CARRIAGE[name], rel=0.1)


def test_positions_alone_say_what_velocities_say():
    runs = data_set({"hardening_spring.k3": 2e-4}, kinds=(KINDS[0], *KINDS[2:]), t=T[:2001])
    h = runs[0].sample_time
    places = [replace(r, v1=None, v2=None, x1=np.cumsum(r.v1) * h, x2=np.cumsum(r.v2) * h) for r in runs]
    found = diagnose(places, settings=QUICK)
    assert found.findings[0].id == "hardening_spring"
    assert found.drive["hardening_spring.k3"] == pytest.approx(2e-4, rel=0.1)
    assert sum(f.after_position_rms for f in found.per_recording) < 0.9 * sum(
        f.before_position_rms for f in found.per_recording
    )
