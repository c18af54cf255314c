import gzip
from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym.recording import Recording
from flexdrive_gym.units import Units
from identification.recordings import RecordingError, read_recordings, write_recording, write_rig
from tests.each import each
from tests.identification.recordings.logs import closed_loop, open_loop, recording, time


def test_open_loop_runs_have_the_rigs_format(tmp_path):
    write_recording(recording(), tmp_path / "a.csv")
    head, first, second, *_ = (tmp_path / "a.csv").read_text().splitlines()
    assert head == "t_s,u_V,v1_mm_s,v2_mm_s"
    assert first == "0.000,-2,0.0000,0.0000"
    assert second.startswith("0.001,-2,")


def test_closed_loop_runs_have_the_rigs_format(tmp_path):
    t, u, xr, x1, x2 = closed_loop()
    write_recording(Recording("r", t, u, xr=xr, x1=x1, x2=x2), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("t_s,u_V,xr_mm,x1_mm,x2_mm\n0.000,0,0.0000,")


def test_other_runs_get_all_they_have(tmp_path):
    _, _, x1, _ = open_loop()
    run = replace(recording(), x1=x1, v2=None)
    write_recording(run, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("t_s,u_V,x1_mm,v1_mm_s\n")


@each("name", ["a.csv", "a.csv.gz"])
def test_reading_back_gives_the_same_run(tmp_path, name):
    run = recording()
    path = write_recording(run, tmp_path / "new" / name)
    (again,) = read_recordings(path)
    for channel in ("t", "u", "v1", "v2"):
        np.testing.assert_allclose(getattr(again, channel), getattr(run, channel), atol=5.1e-5)
    assert again.excitation.kind == "square"
    assert again.quantum == pytest.approx(run.quantum, rel=1e-5)
    assert [item.name for item in path.parent.iterdir()] == [name]


def test_six_digits_of_the_command_and_no_negative_zero(tmp_path):
    t = time(0.5)
    u, v = np.full(t.size, 1.23456789), np.full(t.size, -1e-9)
    write_recording(Recording("r", t, u, v1=v), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[1] == "0.000,1.23457,0.0000"


def test_a_finer_sampling_period_survives(tmp_path):
    t = np.arange(800) * 0.25e-3
    write_recording(Recording("r", t, np.sin(40 * t), v1=50 * np.sin(40 * t)), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[2].startswith("0.000250,")


def test_the_same_run_gives_the_same_bytes(tmp_path):
    first = write_recording(recording(), tmp_path / "a.csv.gz").read_bytes()
    assert write_recording(recording(), tmp_path / "b.csv.gz").read_bytes() == first
    assert gzip.decompress(first) == write_recording(recording(), tmp_path / "c.csv").read_bytes()


@each("name", ["a.mat", "a.txt", "a"])
def test_other_extensions_are_refused(tmp_path, name):
    with pytest.raises(RecordingError, match=r"written as .csv or .csv.gz; got .* Name the file a.csv"):
        write_recording(recording(), tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_rig_in_radians_is_written_and_read_back_in_radians(tmp_path):
    rotary = Units("rad", "N m", per_length=1000.0, per_command=100.0)
    run = replace(recording(), units=rotary)
    path = write_recording(run, tmp_path / "a.csv")
    assert path.read_text().startswith("t [s],u [N m],v1 [rad/s],v2 [rad/s]\n")
    rig = write_rig(rotary, 2, tmp_path / "rig.toml", "servo")
    (again,) = read_recordings(path, rig=rig)
    told, was = again.in_rig_units(), run.in_rig_units()
    assert (again.units.length, again.units.command) == ("rad", "N m")
    for channel in ("u", "v1", "v2"):
        np.testing.assert_allclose(getattr(told, channel), getattr(was, channel), rtol=1e-8, atol=1e-12)
    assert told.quantum == pytest.approx(was.quantum, rel=1e-5)
    # without the description nobody takes newton metres for volts
    with pytest.raises(RecordingError, match=r"u \[N m\]: the unit must be one of voltage"):
        read_recordings(path)
