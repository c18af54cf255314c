import gzip
import re
from datetime import datetime

import numpy as np
import pytest
import scipy.io

from identification.recordings import RecordingError, read_recordings
from identification.recordings.rig import parse_rig
from tests.each import each
from tests.identification.recordings.logs import (
    COUNT,
    TS,
    closed_loop,
    csv_text,
    open_loop,
    position_log,
    speed,
    time,
    trajectory,
    velocity_log,
    write_csv,
)


def read_one(path):
    (run,) = read_recordings(path)
    return run


def test_an_open_loop_log_of_the_rig(tmp_path):
    run = read_one(write_csv(tmp_path / "monday.csv", velocity_log()))
    assert (run.name, run.source, run.notes, run.faults) == ("monday", "monday.csv", (), ())
    assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-5)
    assert run.velocity_cutoff == 0.0
    assert str(run.excitation) == "square ±2 V, 0.5 Hz"
    assert run.sample_time == pytest.approx(TS)
    assert run.x1 is run.x2 is run.xr is None


def test_a_closed_loop_log_of_the_rig_is_not_differentiated(tmp_path):
    run = read_one(write_csv(tmp_path / "loop.csv", position_log()))
    assert run.closed_loop
    assert run.excitation.feedback == "x2"
    assert run.excitation.gain == pytest.approx(0.05, rel=1e-3)
    assert run.v1 is run.v2 is None
    assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-4)


def test_units_are_converted(tmp_path):
    t, u, x1, x2 = open_loop()
    log = {"Time (ms)": 1e3 * t, "u [mV]": 1e3 * u, "x1 (m)": 1e-3 * x1, "v2_m_s": 1e-3 * speed(x2)}
    run = read_one(write_csv(tmp_path / "a.csv", log))
    for found, wanted in ((run.t, t), (run.u, u), (run.x1, x1), (run.v2, speed(x2))):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-4)
    assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-3)


def test_filtered_velocity_beside_its_position(tmp_path):
    t, u, x1, _ = open_loop()
    a, v = np.exp(-2.0 * np.pi * 15.0 * TS), np.zeros(t.size)
    for n, d in enumerate(speed(x1)[1:], start=1):
        v[n] = a * v[n - 1] + (1.0 - a) * d
    log = {"t": t, "u": u, "x1": x1, "v1": v}
    assert read_one(write_csv(tmp_path / "a.csv", log)).velocity_cutoff == pytest.approx(15.0, rel=1e-2)
    alone = write_csv(tmp_path / "b.csv", {"t": t, "u": u, "v1": v})
    assert read_one(alone).velocity_cutoff is None


def test_a_still_cart_borrows_the_count_of_the_other_runs(tmp_path):
    log = velocity_log()
    write_csv(tmp_path / "a.csv", log)
    write_csv(tmp_path / "b.csv", velocity_log("sine", 0.45, 20.0) | {"v2_mm_s": 0.0 * log["t_s"]})
    assert read_recordings(tmp_path)[1].quantum[1] == pytest.approx(COUNT, rel=1e-5)
    assert read_one(tmp_path / "b.csv").quantum[1] == 0.0


def test_matlab_and_csv_give_the_same_run(tmp_path):
    log = velocity_log()
    names = {"t": log["t_s"], "u": log["u_V"], "v1": log["v1_mm_s"], "v2": log["v2_mm_s"]}
    scipy.io.savemat(tmp_path / "a.mat", names)
    matlab, csv = read_one(tmp_path / "a.mat"), read_one(write_csv(tmp_path / "a.csv", log))
    assert str(matlab.excitation) == str(csv.excitation)
    np.testing.assert_allclose(matlab.v1, csv.v1, atol=1e-4)


class TestFolders:
    def test_recursive_sorted_unique_and_without_other_files(self, tmp_path):
        text = csv_text(velocity_log())
        other = csv_text(velocity_log("sine", 2.5, 2.0))
        for folder in ("day2", "day1", ".cache"):
            (tmp_path / folder).mkdir()
            (tmp_path / folder / "run.csv").write_text(text if folder == "day1" else other)
        (tmp_path / "day1" / "slow.csv.gz").write_bytes(gzip.compress(other.encode()))
        (tmp_path / "README.md").write_text("# lab")
        text = csv_text(velocity_log("sine", 2.5, 3.0))
        (tmp_path / "day2" / "run.csv").write_text(text)
        runs = read_recordings(tmp_path)
        assert [run.name for run in runs] == ["day1_run", "slow", "day2_run"]
        assert [run.source for run in runs] == ["day1/run.csv", "day1/slow.csv.gz", "day2/run.csv"]

    def test_the_same_stem_in_two_formats(self, tmp_path):
        log = velocity_log("sine", 2.5, 2.0)
        write_csv(tmp_path / "run.csv", velocity_log())
        scipy.io.savemat(tmp_path / "run.mat", {"t": log["t_s"], "u": log["u_V"], "v1": log["v1_mm_s"]})
        assert [run.name for run in read_recordings(tmp_path)] == ["run_csv", "run_mat"]

    def test_the_same_run_twice_is_kept_once_with_most_channels(self, tmp_path):
        log = velocity_log()
        scipy.io.savemat(tmp_path / "a.mat", {"t": log["t_s"], "u": log["u_V"], "v1": log["v1_mm_s"]})
        write_csv(tmp_path / "b.csv", log)
        write_csv(tmp_path / "copy.csv", log)
        runs = read_recordings(tmp_path)
        assert [run.source for run in runs] == ["b.csv"]
        assert [(item.file, item.reason) for item in runs.skipped] == [
            ("a.mat", "the same run as b.csv"),
            ("copy.csv", "the same run as b.csv"),
        ]

    def test_files_of_one_name_that_are_named_themselves(self, tmp_path):
        for folder, frequency in (("a", 2.0), ("b", 3.0)):
            (tmp_path / folder).mkdir()
            write_csv(tmp_path / folder / "run.csv", velocity_log("sine", 2.5, frequency))
        (tmp_path / "c").mkdir()
        (tmp_path / "c" / "run.csv").write_text("notes")
        runs = read_recordings([tmp_path / folder / "run.csv" for folder in "abc"])
        assert [run.name for run in runs] == ["a_run", "b_run"]
        assert [item.file for item in runs.skipped] == ["run.csv"]

    def test_replicates_are_no_copies(self, tmp_path):
        log = velocity_log()
        write_csv(tmp_path / "a.csv", log)
        write_csv(tmp_path / "b.csv", {**log, "v1_mm_s": np.roll(log["v1_mm_s"], 1)})
        assert len(read_recordings(tmp_path)) == 2

    def test_files_and_folders_together_and_each_file_once(self, tmp_path):
        write_csv(tmp_path / "a.csv", velocity_log())
        write_csv(tmp_path / "b.csv", velocity_log("sine", 2.5, 2.0))
        runs = read_recordings([tmp_path / "b.csv", tmp_path, str(tmp_path / "a.csv")])
        assert sorted(run.name for run in runs) == ["a", "b"]

    def test_a_trajectory_is_left_out_of_a_folder_and_refused_by_name(self, tmp_path):
        write_csv(tmp_path / "a.csv", velocity_log())
        reference = write_csv(tmp_path / "trajectory.csv", {"t_s": time(2.0), "xr_mm": trajectory(time(2.0))})
        runs = read_recordings(tmp_path, strict=True)
        assert [run.name for run in runs] == ["a"]
        assert runs.skipped[0].file == "trajectory.csv"
        assert "reference trajectory" in runs.skipped[0].reason
        assert runs.summary() == "1 recording read; 1 file left out"
        with pytest.raises(RecordingError, match=r"trajectory.csv: .* reference trajectory, not a recording"):
            read_recordings(reference)

    def test_one_bad_file_never_stops_a_folder_unless_strict(self, tmp_path):
        (tmp_path / "day1").mkdir()
        write_csv(tmp_path / "a.csv", velocity_log())
        (tmp_path / "day1" / "broken.csv").write_text("t,u,v1\n0,oops,1\n")
        with pytest.raises(RecordingError, match=r"^day1/broken.csv: column u: must hold numbers; got 'oops'"):
            read_recordings(tmp_path, strict=True)
        for paths in (tmp_path, [tmp_path / "a.csv", tmp_path / "day1" / "broken.csv"]):
            runs = read_recordings(paths)
            assert len(runs) == 1
            assert runs.skipped[0].reason.startswith("column u: must hold numbers")
        with pytest.raises(RecordingError, match=r"^broken.csv: column u"):
            read_recordings(tmp_path / "day1" / "broken.csv")

    def test_nothing_readable_lists_every_reason_once(self, tmp_path):
        for k in range(30):
            (tmp_path / f"a{k:02d}.csv").write_text("t,u,v1\n0,oops,1\n")
            (tmp_path / f"b{k:02d}.csv").write_text(f"t,u,v1\n0,{k}oops,1\n")
        with pytest.raises(RecordingError, match="got none in 60 files") as caught:
            read_recordings(tmp_path)
        lines = str(caught.value).splitlines()
        assert len(lines) == 22
        assert lines[1].startswith("  a00.csv and 29 more: column u: must hold numbers")
        assert lines[-1] == "  and 11 more files"

    def test_only_and_skip(self, tmp_path):
        write_csv(tmp_path / "a.csv", velocity_log())
        write_csv(tmp_path / "b.csv", velocity_log("sine", 2.5, 2.0))
        assert [run.name for run in read_recordings(tmp_path, only=["a*"])] == ["a"]
        assert [run.name for run in read_recordings(tmp_path, skip=["a*"])] == ["b"]
        with pytest.raises(RecordingError, match="no file that was asked for"):
            read_recordings(tmp_path, only=["c*"])

    def test_a_folder_without_logs(self, tmp_path):
        for name in ("log.m", "log.pdf"):
            (tmp_path / name).write_text("")
        with pytest.raises(RecordingError, match=r"folder: must contain .csv, .*; got log.m, log.pdf. Export"):
            read_recordings(tmp_path)

    def test_a_spreadsheet_is_left_out_with_its_reason_and_a_drawing_is_not_even_listed(self, tmp_path):
        write_csv(tmp_path / "a.csv", velocity_log())
        (tmp_path / "b.xlsx").write_bytes(b"PK")
        (tmp_path / "c.bmp").write_bytes(b"BM")
        (item,) = read_recordings(tmp_path).skipped
        assert item.file == "b.xlsx"
        assert "Export the log as .csv" in item.reason

    def test_an_empty_folder(self, tmp_path):
        with pytest.raises(RecordingError, match="got nothing"):
            read_recordings(tmp_path)

    def test_a_folder_of_trajectories_only(self, tmp_path):
        write_csv(tmp_path / "trajectory.csv", {"t_s": time(2.0), "xr_mm": trajectory(time(2.0))})
        with pytest.raises(RecordingError, match=r"(?s)got none in 1 file.*trajectory.csv: .* reference trajectory"):
            read_recordings(tmp_path)

    def test_a_missing_path_suggests_its_neighbour(self, tmp_path):
        write_csv(tmp_path / "square.csv", velocity_log())
        with pytest.raises(RecordingError, match=r"must exist; got no such .* Did you mean square.csv\?"):
            read_recordings(tmp_path / "sqare.csv")
        with pytest.raises(RecordingError, match="Check the spelling"):
            read_recordings(tmp_path / "nowhere" / "square.csv")

    def test_no_paths(self):
        with pytest.raises(RecordingError, match="at least one file or folder is needed"):
            read_recordings([])

    def test_unknown_extension_by_name(self, tmp_path):
        (tmp_path / "a.cvs").write_text("t,u,v1\n")
        with pytest.raises(RecordingError, match=r"a.cvs: extension: .* Did you mean .csv"):
            read_recordings(tmp_path / "a.cvs")


class TestImperfectLogs:
    def test_an_encoder_that_catches_up_at_once_spoils_its_own_samples_only(self, tmp_path):
        log = {name: values.copy() for name, values in velocity_log().items()}
        v = log["v1_mm_s"]
        v[2600] = np.sum(v[2500:2601])
        v[2500:2600] = 0.0
        assert abs(v[2600]) > 1e4
        for name, columns in (("a", log), ("b", velocity_log("sine", 2.5, 2.0))):
            write_csv(tmp_path / f"{name}.csv", columns)
        first, second = read_recordings(tmp_path)
        assert [(f.where, f.id) for f in first.faults] == [("encoder_1", "encoder_dropout")]
        assert np.flatnonzero(~first.valid("v1")).tolist() == list(range(2499, 2601))
        assert second.faults == ()
        assert first.quantum == pytest.approx((COUNT, COUNT), rel=1e-5)
        assert str(first.excitation) == "square ±2 V, 0.5 Hz"

    def test_missing_values_are_faults_of_their_encoder_or_the_run(self, tmp_path):
        log = {name: values.copy() for name, values in velocity_log().items()}
        log["v1_mm_s"][2400:2403], log["u_V"][500] = np.nan, np.nan
        run = read_one(write_csv(tmp_path / "a.csv", log))
        assert [(f.where, f.id, f.start_s, f.end_s) for f in run.faults] == [
            ("recording", "missing_samples", 0.5, 0.5),
            ("encoder_1", "missing_samples", 2.4, 2.402),
        ]
        assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-5)
        assert np.flatnonzero(~run.valid("v1")).tolist() == [500, 2400, 2401, 2402]
        assert run.excitation.kind == "square"

    def test_a_gap_is_masked_in_all_channels(self, tmp_path):
        keep = np.r_[0:1200, 1210:4001]
        log = {name: values[keep] for name, values in velocity_log().items()}
        run = read_one(write_csv(tmp_path / "a.csv", log))
        assert "gaps in time" in run.notes[0]
        assert np.flatnonzero(~run.valid("v2")).tolist() == list(range(1200, 1210))
        assert run.n == 4001

    def test_jitter_keeps_the_count_of_the_raw_log(self, tmp_path):
        t, u, xr, x1, x2 = closed_loop()
        stamps = t + 0.1e-3 * np.sin(37.0 * np.arange(t.size))
        run = read_one(write_csv(tmp_path / "a.csv", {"t": stamps, "u": u, "xr": xr, "x1": x1, "x2": x2}))
        assert "jitter" in run.notes[0]
        assert run.quantum == pytest.approx((COUNT, COUNT), rel=1e-3)
        assert np.ptp(np.diff(run.t)) < 1e-9

    def test_ignored_columns_are_noted(self, tmp_path):
        log = velocity_log()
        run = read_one(write_csv(tmp_path / "a.csv", log | {"flag": np.ones(log["t_s"].size)}))
        assert run.notes == ("columns ignored: flag",)

    def test_a_column_that_is_ignored_for_its_unit_is_said_to_be_and_the_remedy_reads_it(self, tmp_path):
        log = velocity_log()
        speed = log.pop("v2_mm_s")
        log["v2_furlong_s"] = speed / 201168.0
        path = write_csv(tmp_path / "a.csv", log)
        ignored, why = read_one(path).notes
        assert ignored == "columns ignored: v2_furlong_s"
        columns, units = re.search(
            r"what it is: (.*) and (.*), where F is the factor from furlong_s to mm/s", why
        ).groups()
        text = f"{columns}\n{units}".replace("] ", "]\n").replace("= F", "= 201168.0")
        (tmp_path / "rig.toml").write_text(text)
        (run,) = read_recordings(path, rig=tmp_path / "rig.toml")
        assert run.v2 == pytest.approx(speed)

    def test_a_unit_that_is_written_as_one_is_said_to_be_unknown(self, tmp_path):
        log = velocity_log()
        log["v2 (furlong/s)"] = log.pop("v2_mm_s")
        _ignored, why = read_one(write_csv(tmp_path / "a.csv", log)).notes
        assert why.startswith("v2 (furlong/s): 'furlong/s' is no known unit of v2. Convert the column to mm/s")

    def test_another_column_of_a_signal_that_is_read_has_no_unit_to_speak_of(self, tmp_path):
        log = velocity_log()
        run = read_one(write_csv(tmp_path / "a.csv", log | {"v2_filtered": log["v2_mm_s"]}))
        assert not any("unit" in note for note in run.notes)

    def test_a_constant_command_and_a_drive_at_rest_are_noted(self, tmp_path):
        t = time(1.0)
        log = {"t": t, "u": np.full(t.size, 0.2), "v1": 0.0 * t}
        run = read_one(write_csv(tmp_path / "a.csv", log))
        assert run.notes == ("u is constant at 0.2 V", "nothing moves")

    @each(
        ("change", "match"),
        [
            ({"u_V": 0.0, "v1_mm_s": 0.0, "v2_mm_s": 0.0}, "a.csv: column u: the drive must be excited"),
            ({"t_s": 1e3}, "a.csv: time: the sampling period must be below 0.5 s; got 1 s"),
            ({"v1_mm_s": 1e-3, "v2_mm_s": 1e-3}, "a.csv: column v1: a cart that moves"),
        ],
    )
    def test_what_cannot_be_a_recording_is_refused(self, tmp_path, change, match):
        log = {name: values * change.get(name, 1.0) for name, values in velocity_log().items()}
        with pytest.raises(RecordingError, match=match):
            read_recordings(write_csv(tmp_path / "a.csv", log))

    def test_columns_of_different_length(self, tmp_path):
        scipy.io.savemat(tmp_path / "a.mat", {"t": time(1.0), "u": np.ones(1001), "v1": np.ones(900)})
        with pytest.raises(RecordingError, match="column v1: must have as many values as time; got 900 values"):
            read_recordings(tmp_path / "a.mat")

    def test_only_a_recording_error_is_raised_and_it_is_a_value_error(self, tmp_path):
        (tmp_path / "a.csv").write_bytes(bytes(range(256)) * 4)
        with pytest.raises(ValueError, match="a.csv"):
            read_recordings(tmp_path / "a.csv")

    def test_a_free_decay_is_a_recording(self, tmp_path):
        log = velocity_log()
        run = read_one(write_csv(tmp_path / "a.csv", {**log, "u_V": 0.0 * log["t_s"]}))
        assert run.notes == ("u is 0 V throughout: the carts move by themselves, as when plucked by hand",)

    def test_a_filtered_velocity_serves_where_there_is_no_raw_one(self, tmp_path):
        log = velocity_log()
        run = read_one(write_csv(tmp_path / "a.csv", {"t": log["t_s"], "u": log["u_V"], "v1_filt": log["v1_mm_s"]}))
        assert run.velocity_cutoff is None
        assert "v1 is filtered (v1_filt): no raw one is in the file" in run.notes

    @each(
        ("stamps", "note", "recorded"),
        [
            (lambda t: 1e3 * t, "warning: the time column has no unit; its stamps are read as milliseconds", None),
            (lambda t: 739941.25 + t / 86400.0, "time stamps are MATLAB's day numbers", datetime(2025, 11, 20, 6)),
            (lambda t: 1763637684.0 + t, "time stamps are seconds since 1970", datetime(2025, 11, 20, 11, 21, 24)),
        ],
    )
    def test_stamps_of_other_clocks(self, tmp_path, stamps, note, recorded):
        log = velocity_log()
        table = np.column_stack([stamps(log["t_s"]), log["u_V"], log["v1_mm_s"]])
        np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,v1", comments="", fmt="%.12f")
        run = read_one(tmp_path / "a.csv")
        assert note in run.notes
        assert run.recorded == recorded
        assert run.sample_time == pytest.approx(1e-3, rel=1e-3)


def bare_log():
    return dict(zip(("t", "u", "x1"), open_loop(), strict=False))


@each("factor", [1e3, 1e-3])
@each(
    ("log", "name"),
    [
        *((velocity_log, name) for name in ("t_s", "u_V", "v1_mm_s", "v2_mm_s")),
        *((position_log, name) for name in ("t_s", "u_V", "x1_mm", "x2_mm", "xr_mm")),
        *((bare_log, name) for name in ("t", "u", "x1")),
    ],
)
def test_what_is_a_thousand_times_off_is_refused_or_warned_of(tmp_path, log, name, factor):
    columns = dict(log())
    columns[name] = columns[name] * factor
    try:
        run = read_one(write_csv(tmp_path / "a.csv", columns))
    except RecordingError as error:
        said = str(error)
    else:
        said = " ".join(run.notes)
    assert "got " in said or "warning: " in said


def test_a_struct_array_of_runs_names_each(tmp_path):
    log = velocity_log()
    runs = np.empty(2, dtype=[("t", object), ("u", object), ("v1", object)])
    for k in range(2):
        runs[k] = (log["t_s"], (k + 1.0) * log["u_V"], log["v1_mm_s"])
    scipy.io.savemat(tmp_path / "a.mat", {"run": runs})
    with pytest.raises(RecordingError, match=r"got run\(1\).u and run\(2\).u, both u"):
        read_recordings(tmp_path / "a.mat")
    text = "".join(f'{role} = "run(2).{role}"\n' for role in ("t", "u", "v1"))
    (run,) = read_recordings(tmp_path / "a.mat", rig=parse_rig("[columns]\n" + text))
    np.testing.assert_allclose(run.u, 2.0 * log["u_V"])
