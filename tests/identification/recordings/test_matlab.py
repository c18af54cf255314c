import struct
from datetime import datetime

import h5py
import numpy as np
import pytest
import scipy.io

from identification.recordings import RecordingError
from identification.recordings.files import read_tables
from identification.recordings.rig import Rig, parse_rig
from identification.recordings.roles import find_roles
from tests.each import each
from tests.identification.recordings.logs import sine, time

T = time(0.3)
U = sine(T, 2.0, 5.0)
V = np.cumsum(U)


def cells(*items):
    array = np.empty(len(items), dtype=object)
    array[:] = items
    return array


def structs(*entries):
    """Return a MATLAB struct array."""
    array = np.empty(len(entries), dtype=[(key, object) for key in entries[0]])
    for k, entry in enumerate(entries):
        array[k] = tuple(entry.values())
    return array


def roles(path, rig=""):
    return find_roles(read_tables(path)[0], parse_rig(rig) if rig else Rig(), path.name)


def read(path, names=("t", "u", "v1"), values=(T, U, V), rig=""):
    found = roles(path, rig)
    assert set(found.signals) == set(names)
    for name, wanted in zip(names, values, strict=True):
        np.testing.assert_allclose(found.signals[name], wanted, atol=1e-12)
    return found


@each("version", ["4", "5"])
def test_vectors(tmp_path, version):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U, "v1": V, "Kp": 3.0}, format=version)
    read(tmp_path / "a.mat")


@each("compressed", [False, True])
def test_vectors_in_a_struct_and_stamps_in_ms(tmp_path, compressed):
    run = {"t_ms": 1e3 * T, "u": U, "v1": V, "name": "first"}
    scipy.io.savemat(tmp_path / "a.mat", {"run": run}, do_compression=compressed)
    read(tmp_path / "a.mat")


def test_structure_with_time_of_several_signals(tmp_path):
    signals = structs(
        {"values": U, "label": "u", "blockName": "m/Gain"}, {"values": V, "label": "<v1>", "blockName": "m/v"}
    )
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": T, "signals": signals}})
    read(tmp_path / "a.mat")


def test_structures_with_time_named_by_their_variable_or_block(tmp_path):
    one = {"time": T, "signals": {"values": U, "label": "", "blockName": "model/To Workspace"}}
    two = {"time": T, "signals": structs({"values": V, "label": "", "blockName": "model/v1"})}
    scipy.io.savemat(tmp_path / "a.mat", {"u": one, "out": two})
    read(tmp_path / "a.mat")


def test_vector_signal_labelled_with_commas(tmp_path):
    signals = {"values": np.column_stack([U, V]), "label": "u, v1"}
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": T, "signals": signals}})
    read(tmp_path / "a.mat")


def test_vector_signal_without_names_has_them_by_number(tmp_path):
    signals = {"values": np.column_stack([U, V]), "label": "mux"}
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": T, "signals": signals}})
    with pytest.raises(RecordingError, match=r"must contain the command; got columns S:1, S:2.*'S:2'"):
        roles(tmp_path / "a.mat")
    read(tmp_path / "a.mat", rig='[columns]\nu = "S:1"\nv1 = "S(:,2)"')


def test_structure_without_time_takes_the_clock_of_its_length(tmp_path):
    scope = {"time": [], "signals": {"values": U, "label": "u"}}
    scipy.io.savemat(tmp_path / "a.mat", {"S": scope, "t": T, "t2": T[:200], "v1": V})
    read(tmp_path / "a.mat")


def test_timeseries_structs(tmp_path):
    first, second = {"Time": T, "Data": U, "Name": "u"}, {"Time": T, "Data": V, "Name": ""}
    scipy.io.savemat(tmp_path / "a.mat", {"a": first, "v1": second})
    assert read(tmp_path / "a.mat").notes == ()


def test_signals_of_different_rates_are_joined_on_the_commands_time(tmp_path):
    slow = T[::4]
    ramp = {"Time": slow, "Data": 3.0 * slow, "Name": "x1"}
    scipy.io.savemat(tmp_path / "a.mat", {"b": ramp, "a": {"Time": T, "Data": U, "Name": "u"}})
    inside = slow[-1] >= T
    found = read(tmp_path / "a.mat", ("t", "u", "x1"), (T[inside], U[inside], 3.0 * T[inside]))
    assert found.notes == ("1 signals joined on one time base",)


def test_a_reference_of_another_rate_is_held(tmp_path):
    slow = T[::100]
    steps = {"Time": slow, "Data": np.arange(slow.size), "Name": "xr"}
    scipy.io.savemat(tmp_path / "a.mat", {"r": steps, "a": {"Time": T, "Data": U, "Name": "u"}, "v1": V})
    held = roles(tmp_path / "a.mat").signals["xr"]
    assert set(held) == {0.0, 1.0, 2.0, 3.0}
    assert held[99] == 0.0
    assert held[100] == 1.0


def test_signals_of_different_runs_are_refused(tmp_path):
    late = {"Time": T + 9.0, "Data": V, "Name": "v1"}
    scipy.io.savemat(tmp_path / "a.mat", {"b": late, "a": {"Time": T, "Data": U, "Name": "u"}})
    with pytest.raises(RecordingError, match="all signals must cover a common span"):
        roles(tmp_path / "a.mat")


@each("labels", [cells("t", "u", "v1"), np.array(["t", "u", "v1"])], ids=["cell", "char"])
def test_array_with_names_beside_it(tmp_path, labels):
    scipy.io.savemat(tmp_path / "a.mat", {"out": np.column_stack([T, U, V]), "labels": labels})
    read(tmp_path / "a.mat")


def test_array_without_names(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"out": np.column_stack([T, U, V])})
    with pytest.raises(
        RecordingError, match=r"must contain time; got columns out:1, .*rig.toml calls the second of out 'out:2'"
    ):
        roles(tmp_path / "a.mat")
    for written in ("out:{}", "out({})", "out(:,{})"):
        columns = "".join(f'{role} = "{written.format(k)}"\n' for k, role in enumerate(("t", "u", "v1"), 1))
        read(tmp_path / "a.mat", rig="[columns]\n" + columns)


def test_what_nobody_needs_is_passed_over(tmp_path):
    other = {
        "A": np.eye(4),
        "poles": np.array([1 + 2j, 1 - 2j]),
        "gains": {"Kp": 3.0},
        "G": np.ones((30, 4)),
        "none": [],
    }
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U, "v1": V, **other})
    read(tmp_path / "a.mat")


def test_to_workspace_arrays_pair_each_value_with_its_time(tmp_path):
    log = {"uexp": np.column_stack([T, U]), "v1exp": np.column_stack([T, V])}
    copies = {"u": 2.0 * U[:200], "v1": 2.0 * V[:200], "t": T[:200]}
    scipy.io.savemat(tmp_path / "a.mat", {**log, **copies})
    read(tmp_path / "a.mat")


def test_several_clocks_are_told_apart_by_length(tmp_path):
    reference = {"t": T[:150], "s": np.linspace(0.0, 1.0, 150)}
    scipy.io.savemat(tmp_path / "a.mat", {**reference, "t_exp": T, "u": U, "v1": V})
    assert "several clocks: the command's is t_exp" in read(tmp_path / "a.mat").notes


def test_clocks_of_equal_length_are_told_apart_by_name(tmp_path):
    late = T + 0.1
    both = {"t": late, "t_exp": T, "u_exp": U, "v1_exp": V, "v1": -V, "u": -U}
    scipy.io.savemat(tmp_path / "a.mat", both)
    read(tmp_path / "a.mat")
    scipy.io.savemat(tmp_path / "b.mat", {"t": late, "time": T, "u": U, "v1": V})
    with pytest.raises(RecordingError, match=r"time: each signal must have one clock; .*t and time.*\[columns\] t = "):
        roles(tmp_path / "b.mat")
    read(tmp_path / "b.mat", rig='[columns]\nt = "time"')


def test_measured_raw_signals_come_first_and_simulated_copies_never(tmp_path):
    several = {"v1": V, "v1_filt": 0.9 * V, "v1_sim": 0.8 * V, "u": U, "t": T}
    scipy.io.savemat(tmp_path / "a.mat", several)
    read(tmp_path / "a.mat")
    scipy.io.savemat(tmp_path / "b.mat", {key: several[key] for key in ("t", "u", "v1_filt", "v1_sim")})
    found = read(tmp_path / "b.mat", values=(T, U, 0.9 * V))
    assert found.filtered == ("v1",)
    assert "v1 is filtered (v1_filt): no raw one is in the file" in found.notes
    scipy.io.savemat(tmp_path / "c.mat", {key: several[key] for key in ("t", "u", "v1_sim")})
    with pytest.raises(RecordingError, match="must contain at least one of x1, x2, v1, v2"):
        roles(tmp_path / "c.mat")


def test_a_scope_that_repeats_a_vector_is_one_signal(tmp_path):
    scope = {"time": T, "signals": {"values": V, "label": "Measured\nPosition [mm]"}, "blockName": "model/v1"}
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U, "v1": V, "ScopeData_v1": scope})
    read(tmp_path / "a.mat")
    scope["signals"]["values"] = V + 1.0
    scipy.io.savemat(tmp_path / "b.mat", {"t": T, "u": U, "v1": V, "ScopeData_v1": scope})
    with pytest.raises(RecordingError, match=r"each signal may appear once; got v1 and .* \[columns\] v1 = \"v1\""):
        roles(tmp_path / "b.mat")


def test_the_date_stands_in_the_header(tmp_path):
    for name, options in (("a.mat", {}), ("2025-11-20_11-21.mat", {"format": "4"})):
        scipy.io.savemat(tmp_path / name, {"t": T, "u": U, "v1": V}, **options)
    text = bytearray((tmp_path / "a.mat").read_bytes())
    text[:116] = b"MATLAB 5.0 MAT-file, Platform: PCWIN64, Created on: Mon Nov 10 11:35:04 2025".ljust(116)
    (tmp_path / "a.mat").write_bytes(text)
    assert read_tables(tmp_path / "a.mat")[0].recorded == datetime(2025, 11, 10, 11, 35, 4)
    assert read_tables(tmp_path / "2025-11-20_11-21.mat")[0].recorded == datetime(2025, 11, 20, 11, 21)


def test_a_header_that_declares_gigabytes_is_refused_before_they_are_allocated(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U}, format="4")
    data = bytearray((tmp_path / "a.mat").read_bytes())
    data[4:12] = struct.pack("<2i", 1 << 20, 1 << 20)
    (tmp_path / "a.mat").write_bytes(data)
    with pytest.raises(RecordingError, match="must be a complete MATLAB file; got ValueError: a variable of 1048576"):
        read_tables(tmp_path / "a.mat")[0]
    scipy.io.savemat(tmp_path / "b.mat", {"c": cells("a", "b")})
    data = bytearray((tmp_path / "b.mat").read_bytes())
    where = data.index(struct.pack("<2i", 1, 2))
    data[where : where + 8] = struct.pack("<2i", 1 << 30, 2)
    (tmp_path / "b.mat").write_bytes(data)
    with pytest.raises(RecordingError, match="2147483648 × 1 entries"):
        read_tables(tmp_path / "b.mat")[0]


def test_file_without_signals(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"Kp": 3.0, "note": "hello"})
    with pytest.raises(RecordingError, match="must hold vectors.*got variables Kp, note.*save\\('run.mat'"):
        read_tables(tmp_path / "a.mat")[0]


@each("size", [0, 60, 200, 2000])
def test_truncated_file(tmp_path, size):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"t": T, "u": U, "v1": V})
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(RecordingError, match=r"a.mat: file: must be a complete MATLAB file.*'-v7'"):
        read_tables(path)[0]


class TestHdf5:
    """Version 7.3 as MATLAB lays it out: transposed, classes as attributes, references into #refs#."""

    @pytest.fixture
    def file(self, tmp_path):
        with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
            yield file

    @staticmethod
    def number(group, name, values):
        data = group.create_dataset(name, data=np.atleast_2d(values))
        data.attrs["MATLAB_class"] = np.bytes_("double")
        return data

    @staticmethod
    def text(group, name, text):
        data = group.create_dataset(name, data=np.array([[ord(letter)] for letter in text], dtype=np.uint16))
        data.attrs["MATLAB_class"] = np.bytes_("char")
        return data

    @staticmethod
    def empty(group, name, kind):
        data = group.create_dataset(name, data=np.zeros(2, dtype=np.uint64))
        data.attrs["MATLAB_class"] = np.bytes_(kind)
        data.attrs["MATLAB_empty"] = 1
        return data

    @staticmethod
    def references(group, name, items):
        data = group.create_dataset(name, (len(items), 1), dtype=h5py.ref_dtype)
        for k, item in enumerate(items):
            data[k, 0] = item.ref
        return data

    @staticmethod
    def path(file):
        file.flush()
        return file.filename

    def test_vectors(self, file, tmp_path):
        for name, values in (("t", T), ("u", U), ("v1", V)):
            self.number(file, name, values)
        self.text(file, "comment", "first run")
        file.close()
        read(tmp_path / "a.mat")

    def test_struct_of_vectors(self, file, tmp_path):
        run = file.create_group("run")
        for name, values in (("t", T), ("u", U), ("v1", V)):
            self.number(run, name, values)
        file.close()
        read(tmp_path / "a.mat")

    def test_structure_with_time(self, file, tmp_path):
        refs = file.create_group("#refs#")
        signals = file.create_group("S/signals")
        self.number(file["S"], "time", T)
        self.references(signals, "values", [self.number(refs, "a", U), self.number(refs, "b", V)])
        self.references(signals, "label", [self.text(refs, "c", "u"), self.text(refs, "d", "v1")])
        self.references(signals, "title", [self.empty(refs, "e", "char"), self.empty(refs, "f", "double")])
        file.close()
        read(tmp_path / "a.mat")

    def test_structure_with_time_of_one_signal(self, file, tmp_path):
        for name, values in (("u", U), ("v1", V)):
            group = file.create_group(name)
            self.number(group, "time", T)
            self.number(group.create_group("signals"), "values", values)
            self.empty(group["signals"], "label", "char")
        file.close()
        read(tmp_path / "a.mat")

    def test_timeseries_structs(self, file, tmp_path):
        for name, values in (("u", U), ("v1", V)):
            group = file.create_group("ts_" + name)
            self.number(group, "Time", T)
            self.number(group, "Data", values)
            self.text(group, "Name", name)
        file.close()
        read(tmp_path / "a.mat")

    def test_array_with_a_cell_of_names(self, file, tmp_path):
        refs = file.create_group("#refs#")
        self.number(file, "out", np.stack([T, U, V]))
        names = self.references(
            file, "names", [self.text(refs, str(k), name) for k, name in enumerate(["t", "u", "v1"])]
        )
        names.attrs["MATLAB_class"] = np.bytes_("cell")
        file.close()
        read(tmp_path / "a.mat")

    def test_objects_are_refused_with_the_remedy(self, file, tmp_path):
        opaque = self.number(file, "ts", np.arange(6.0))
        opaque.attrs["MATLAB_object_decode"] = 3
        file.close()
        with pytest.raises(RecordingError, match="variable ts is an object .* save its Time, Data and Name"):
            read_tables(tmp_path / "a.mat")[0]

    def test_truncated(self, file, tmp_path):
        self.number(file, "t", T)
        file.close()
        path = tmp_path / "a.mat"
        path.write_bytes(path.read_bytes()[:1500])
        with pytest.raises(RecordingError, match="must be a complete MATLAB file"):
            read_tables(path)[0]
