"""What a check says, and what it writes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexdrive_gym import Drive
from flexdrive_gym.units import LAB
from identification import check, read_recordings, write_recording
from identification.readiness.describe import describe, write_description
from identification.readiness.identifiability import trade_offs
from identification.readiness.plausible import implausible
from identification.recordings import load_rig, recognise_excitation
from identification.topology import GROUND_MASS
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, T, data_set, run

DRIVE = Drive({**RIG, **COUNTS})


@pytest.fixture(scope="module")
def checked():
    return check(data_set())


def test_a_data_set_is_ready_and_determines_what_it_should(checked):
    assert checked.ready
    assert checked.line().startswith("ready: 6 of 6 recordings can be fitted")
    assert {"m1", "m2", "k", "b1"} <= {n for n, ok in checked.found.determined.items() if ok}
    assert checked.comparison is None


def test_the_object_of_the_contract(checked):
    found = json.loads(json.dumps(checked.as_json()))
    assert set(found) >= {"recordings", "skipped", "sessions", "identifiable", "trade_offs", "advice", "ready"}
    first = found["recordings"][0]
    assert first["experiment"] == "square"
    assert first["rate_hz"] == 1000.0
    assert first["channels"] == ["u", "v1", "v2"]
    assert found["sessions"] == [{"id": "1", "recordings": 6}]
    assert "what was understood" in str(checked)
    assert str(checked).endswith(checked.line())


def test_fast_sines_tell_nothing_of_cart_2():
    runs = [run(DRIVE, "sine", 2.5, f, force=0.3, seed=i, name=f"run {i}") for i, f in enumerate((15.0, 20.0))]
    found = check(runs)
    assert found.found.determined["m1"]
    assert not found.found.determined["b2"]
    assert not found.ready
    assert any("square waves" in text for text in found.advice)
    assert any("resonance" in text and "handout 2.6" in text for text in found.advice)


def test_a_trade_off_is_named_with_what_is_determined():
    # b1 + 1.7 b2 is known to 1 %, and what changes neither is free
    b1, b2 = 0.010, 0.004
    along = np.array([1.7 / b1, -1.0 / b2])  # relative changes that leave b1 + 1.7 b2 as it is
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    covariance = 0.5**2 * np.outer(along, along) + 0.01**2 * np.outer(across, across)
    (sentence,) = trade_offs(["b1", "b2"], np.array([b1, b2]), covariance, LAB)
    assert sentence == "b1 and b2: only b1 + 1.7·b2 is determined"


def test_nothing_usable_is_not_ready():
    held = [replace(r, held=(2,)) for r in data_set()[:2]]
    found = check(held)
    assert not found.ready
    assert "no recording of two free carts" in found.line()
    assert found.as_json()["identifiable"] == {}


def test_a_turned_command_is_found_by_the_energy_it_takes():
    runs = data_set()
    assert implausible(runs) == ()
    turned = implausible([replace(r, u=-r.u) for r in runs])
    assert [w.kind for w in turned] == ["sign of u"]
    other = implausible([replace(r, v2=-r.v2) for r in runs[:3]])
    assert [w.kind for w in other] == ["sign of x2"]


def test_exchanged_carts_are_found_by_the_one_that_the_command_acts_on():
    runs = data_set()
    exchanged = [replace(r, x1=r.x2, x2=r.x1, v1=r.v2, v2=r.v1) for r in runs]
    assert [w.kind for w in implausible(exchanged)] == ["carts"]
    found = check(exchanged)
    assert not found.ready
    assert "exchange the columns of x1 and x2" in found.line() + " ".join(found.warnings)
    # whichever way the encoders count
    turned = implausible([replace(r, x1=None if r.x1 is None else -r.x1, v1=-r.v1) for r in runs])
    assert "carts" not in {w.kind for w in turned}


def test_counts_that_are_read_as_millimetres():
    r = DRIVE.simulate(T, 2.0 * np.sign(np.sin(np.pi * T + 1e-9)))
    counts = replace(r, x1=np.round(r.x1 / 0.0047), x2=np.round(r.x2 / 0.0047), v1=None, v2=None)
    kinds = {w.kind for w in implausible([counts])}
    assert "counts as mm" in kinds
    assert not check([replace(r, v1=None, v2=None, x1=counts.x1, x2=counts.x2)]).ready


def test_what_was_understood_reads_back(tmp_path):
    u = np.repeat([0.0, 2.0, -2.0, 2.0], 1001)[: len(T)]
    for name, drive in (
        ("free", DRIVE),
        ("free_again", DRIVE.replace(d1=0.4)),
        ("held", DRIVE.replace(m2=GROUND_MASS)),
    ):
        made = drive.simulate(T, u)
        write_recording(replace(made, v1=None, v2=None), tmp_path / "runs" / f"{name}.csv")
    (tmp_path / "runs" / "notes.csv").write_text("name,mark\nA,1\n")
    before = read_recordings(tmp_path / "runs")
    found = check(before)
    assert found.selection.held == {"held": (2,)}
    file = write_description(found, tmp_path / "rig.toml", "my rig")
    after = read_recordings(tmp_path / "runs", rig=file)
    assert [r.name for r in after] == [r.name for r in before]
    for a, b in zip(after, before, strict=True):
        np.testing.assert_array_equal(a.u, b.u)
        np.testing.assert_array_equal(a.x1, b.x1)
    rig = load_rig(file)
    assert rig.name == "my rig"
    assert rig.rule("held.csv").held == (2,)
    assert "# left out: notes.csv:" in file.read_text()
    # a description of what was read with a description says the same again
    again = describe(check(after))
    assert "held = [2]" in again
    (tmp_path / "again.toml").write_text(again)
    assert load_rig(tmp_path / "again.toml").files == rig.files


def test_the_real_rig_is_ready(shared_recordings: Path):
    names = ["square_1.5V_0.5Hz", "square_2.0V_0.5Hz", "sine_2.5V_2.0Hz", "sine_2.5V_3.0Hz", "sine_2.5V_4.0Hz"]
    found = check([shared_recordings / "mte360_2022" / f"{n}.csv" for n in names])
    assert found.ready
    assert recognise_excitation(found.read[0].t, found.read[0].u).kind == "square"
