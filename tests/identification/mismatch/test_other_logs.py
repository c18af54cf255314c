"""The diagnosis takes logs that are not open-loop runs with two velocities."""

from dataclasses import replace

import numpy as np
import pytest

from identification import diagnose, read_recordings
from tests.baselines.public_data.stand_ins import CARRIAGE, write_carriage
from tests.identification.mismatch.lab import KINDS, QUICK, T, data_set

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    write_carriage(folder / "log.csv", 18.0, seed=1)
    return folder


@pytest.fixture(scope="module")
def found(log):
    return diagnose(log, settings=QUICK)


@pytest.fixture(scope="module")
def positions_alone():
    runs = data_set({"hardening_spring.k3": 2e-4}, kinds=(KINDS[0], *KINDS[2:]), t=T[:2001])
    h = runs[0].sample_time
    places = [replace(r, v1=None, v2=None, x1=np.cumsum(r.v1) * h, x2=np.cumsum(r.v2) * h) for r in runs]
    return diagnose(places, settings=QUICK)


def test_one_cart_in_closed_loop_with_positions_only(log, found):
    (recording,) = read_recordings(log / "log.csv")
    assert recording.closed_loop
    assert found.split.blocks
    assert any("blocks are parts of one recording" in note for note in found.notes)
    assert {f.id for f in found.findings} <= {"input_offset", "tilt", "coulomb_asymmetry"}


def test_the_constant_force_of_one_cart_is_named(found):
    assert {f.id for f in found.findings} & {"input_offset", "tilt", "coulomb_asymmetry"}
    for name in ("m1", "b1"):
        assert found.drive[name] == pytest.approx(CARRIAGE[name], rel=0.05)


def test_positions_alone_say_what_velocities_say(positions_alone):
    assert positions_alone.findings[0].id == "hardening_spring"
    assert positions_alone.drive["hardening_spring.k3"] == pytest.approx(2e-4, rel=0.1)
    of = positions_alone.per_recording
    assert sum(f.after_position_rms for f in of) < sum(f.before_position_rms for f in of)


@pytest.mark.xfail(
    strict=True, reason="the reported drives fit velocities, and where positions drift some recordings get worse"
)
def test_no_recording_s_positions_get_worse(positions_alone):
    assert all(f.after_position_rms < f.before_position_rms for f in positions_alone.per_recording)
