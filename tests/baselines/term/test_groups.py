"""Folders are terms and groups; a group's files travel as they lie."""

import pickle
import zipfile

import pytest

from baselines.term.groups import Group, Parcel, find_groups, parcel
from baselines.term.unpack import HandInError


def lay(folder, *names):
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith(".zip"):
            with zipfile.ZipFile(file, "w") as made:
                made.writestr("inner/run.csv", "in an archive")
        else:
            file.write_text(name)
    return folder


def test_every_subfolder_and_archive_is_a_group_in_the_order_people_count(tmp_path):
    lay(tmp_path, "Group 10/a.csv", "Group 2/lab/day/a.csv", "Group 1.zip", "loose.csv", ".git/a.csv")
    groups, notes = find_groups([tmp_path])
    assert [(g.term, g.name) for g in groups] == [("", "Group 1"), ("", "Group 2"), ("", "Group 10")]
    assert "loose.csv lie beside" in notes[0]


def test_several_folders_or_folders_named_by_years_are_terms(tmp_path):
    lay(tmp_path, "winter 2022/rig 1/a.csv", "winter 2022/rig 2/a.csv", "fall 2025/rig 1/a.csv")
    given, _ = find_groups([tmp_path / "winter 2022", tmp_path / "fall 2025"])
    assert [g.label for g in given] == ["winter 2022 / rig 1", "winter 2022 / rig 2", "fall 2025 / rig 1"]
    found, _ = find_groups([tmp_path])
    assert {g.label for g in found} == {g.label for g in given}
    assert [g.label for g in find_groups([tmp_path], terms=False)[0]] == ["fall 2025", "winter 2022"]


def test_terms_in_a_folder_come_in_the_order_of_time(tmp_path):
    lay(tmp_path, *(f"{t}/rig/a.csv" for t in ("fall 2022", "winter 2022", "spring_2021", "winter 2023")))
    assert [g.term for g in find_groups([tmp_path])[0]] == ["spring_2021", "winter 2022", "fall 2022", "winter 2023"]


def test_a_folder_of_recordings_is_one_group(tmp_path):
    lay(tmp_path, "rig/a.csv", "rig/b.csv")
    ((group,), _) = find_groups([tmp_path / "rig"])
    assert (group.term, group.name) == ("", "rig")


def test_a_folder_of_nothing_is_an_error(tmp_path):
    with pytest.raises(ValueError, match=r"FOLDER: must hold a subfolder or a zip archive for each group; got"):
        find_groups([tmp_path])
    (tmp_path / "g").mkdir()
    with pytest.raises(HandInError, match="must hold recordings or a zip archive of them; got nothing"):
        parcel(Group("", "g", tmp_path / "g"))


def test_a_pickled_parcel_needs_no_file_of_ours(tmp_path):
    lay(tmp_path, "g/one.csv", "g/deep/two.csv", "g/three.zip", "g/notes.txt~")
    (tmp_path / "g" / "link.csv").symlink_to("/etc/passwd")
    here = parcel(Group("", "g", tmp_path / "g"))
    there = pickle.loads(pickle.dumps(here))
    assert isinstance(there, Parcel)
    assert (there.digest(), there.size) == (here.digest(), here.size)
    for file in (tmp_path / "g").rglob("*"):
        if file.is_file():
            file.unlink()
    assert there.lay_out(tmp_path / "out") == []
    found = sorted(p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*") if p.is_file())
    assert found == ["deep/two.csv", "one.csv", "three/inner/run.csv"]


def test_a_digest_is_of_names_and_contents(tmp_path):
    lay(tmp_path, "a/run.csv", "b/run.csv", "c/ran.csv")
    (tmp_path / "b" / "run.csv").write_text("changed")
    (tmp_path / "c" / "ran.csv").write_text("run.csv")
    digests = {parcel(Group("", n, tmp_path / n)).digest() for n in "abc"}
    assert len(digests) == 3
