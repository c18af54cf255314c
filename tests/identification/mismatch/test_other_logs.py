"""The diagnosis takes logs that are no open-loop lab day with two velocities."""

from dataclasses import replace

import numpy as np
import pytest

from identification import diagnose, read_recordings
from tests.baselines.public_data.stand_ins import CARRIAGE, write_carriage
from tests.identification.mismatch.lab import SHORT, T, short_day


def test_one_cart_in_closed_loop_with_positions_only(tmp_path):
    write_carriage(tmp_path / "log.csv", 18.0, seed=1)
    (log,) = read_recordings(tmp_path / "log.csv")
    assert log.closed_loop
    found = diagnose([log])
    assert found.split.parts
    assert {f.id for f in found.findings} & {"input_offset", "tilt", "coulomb_asymmetry"}
    for name in ("m1", "b1", "d1"):
        assert found.drive[name] == pytest.approx(CARRIAGE[name], rel=0.05)


def test_positions_alone_say_what_velocities_say():
    day = short_day({"hardening_spring.k3": 2e-4}, kinds=(SHORT[0], *SHORT[2:]), t=T[:2001])
    h = day[0].sample_time
    places = [replace(r, v1=None, v2=None, x1=np.cumsum(r.v1) * h, x2=np.cumsum(r.v2) * h) for r in day]
    found = diagnose(places)
    assert found.findings[0].id == "hardening_spring"
    assert found.drive["hardening_spring.k3"] == pytest.approx(2e-4, rel=0.1)
