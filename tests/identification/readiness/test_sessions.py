"""Sessions: dates first, then folders; and what a merge of two rigs costs."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from flexdrive_gym import Drive, Recording
from identification import identify_by_likelihood, read_recordings, write_recording
from identification.readiness.sessions import compare_sessions, given_folders, reduced, sessions_of
from identification.recordings import RecordingSet
from tests.drive.drives import RIG
from tests.identification.lab import COUNTS, T, data_set


def made(*, source="a.csv", recorded=None, session=""):
    return Recording("r", T[:60], 0 * T[:60], x1=T[:60], source=source, recorded=recorded, session=session)


def test_dates_make_sessions_and_long_gaps_make_more():
    times = [(10, 11, 35), (10, 12, 27), (10, 17, 0), (20, 11, 21), (20, 23, 50), (21, 0, 20)]
    # a file's header says no zone
    runs = [made(recorded=datetime(2025, 11, d, h, m)) for d, h, m in times]
    assert sessions_of(runs) == (
        "2025-11-10 (1)", "2025-11-10 (1)", "2025-11-10 (2)", "2025-11-20 (1)", "2025-11-20 (2)", "2025-11-20 (2)",
    )  # fmt: skip


def test_folders_tell_where_dates_do_not_and_a_description_has_the_last_word():
    assert sessions_of([made(), made()]) == ("1", "1")
    runs = [made(source="mon/a.csv"), made(source="tue/a.csv"), made(source="tue/b.csv", session="mine")]
    assert sessions_of(runs) == ("mon", "tue", "mine")
    assert sessions_of([made(), made()], ["rig a", "rig b"]) == ("rig a", "rig b")


def test_folders_that_were_given_are_told_apart_though_files_are_called_alike(tmp_path):
    for folder, names in (("a", "xyz"), ("b", "yz")):
        for name in names:
            path = tmp_path / folder / f"{name}.csv"
            path.parent.mkdir(exist_ok=True)
            path.touch()
    read = [made(source=f"{n}.csv") for n in "xyzyz"]
    assert given_folders([tmp_path / "a", tmp_path / "b"], read) == ("a", "a", "a", "b", "b")
    assert given_folders([tmp_path / "a"], read) == ("",) * 5


def test_fewer_recordings_keep_every_condition():
    data = [replace(r, name=f"{r.name} {i}") for i in range(10) for r in data_set()]
    some, own = reduced(RecordingSet(data), ["1"] * len(data))
    assert len(some) == len(own) == 24
    assert {str(r.excitation) for r in some} == {str(r.excitation) for r in data}


@pytest.fixture(scope="module")
def two_rigs():
    first = data_set(force=0.2)
    other = Drive({**RIG, **COUNTS, "b2": 4.0 * RIG["b2"], "d2": 2.0 * RIG["d2"]})
    return first, [replace(r, name=f"other {r.name}") for r in data_set(other, force=0.2)]


def test_a_merge_of_two_rigs_has_a_price(two_rigs):
    runs = RecordingSet([*two_rigs[0], *two_rigs[1]])
    found = compare_sessions(runs, ["a"] * 6 + ["b"] * 6, identify_by_likelihood(runs))
    assert "b2" in found.differing
    assert "m1" not in found.differing
    assert found.cost > 0.5
    assert "are merged into one drive, at the cost of" in found.sentence()


def test_the_same_rig_twice_has_none(two_rigs):
    again = [replace(r, name=f"again {r.name}") for r in data_set(force=0.2)]
    again = [replace(r, v1=np.roll(r.v1, 0)) for r in again]
    runs = RecordingSet([*two_rigs[0], *again])
    found = compare_sessions(runs, ["a"] * 6 + ["b"] * 6, identify_by_likelihood(runs))
    assert found.differing == ()
    assert "no parameter differs" in found.sentence()


def test_files_called_alike_in_two_folders_are_all_read(tmp_path):
    for folder, run in zip("ab", data_set()[:2], strict=True):
        write_recording(run, tmp_path / folder / "run.csv")
    read = read_recordings([tmp_path / "a", tmp_path / "b"])
    assert [r.source for r in read] == ["run.csv", "run.csv"]
    assert sessions_of(read, given_folders([tmp_path / "a", tmp_path / "b"], read)) == ("a", "b")
