import h5py
import numpy as np
import pytest
import scipy.io

from identification.recordings import RecordingError
from identification.recordings.files import read_table
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


def read(path, labels=("t_s", "u", "v1"), values=(T, U, V)):
    table = read_table(path)
    found = dict(zip(table.labels, table.values, strict=True))
    assert set(found) == set(labels)
    for label, wanted in zip(labels, values, strict=True):
        np.testing.assert_allclose(found[label], wanted, atol=1e-12)
    return table


@pytest.mark.parametrize("version", ["4", "5"])
def test_vectors(tmp_path, version):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U, "v1": V, "Kp": 3.0}, format=version)
    read(tmp_path / "a.mat")


@pytest.mark.parametrize("compressed", [False, True])
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
    read(tmp_path / "a.mat", ("t_s", "u", "v1"))


def test_vector_signal_labelled_with_commas(tmp_path):
    signals = {"values": np.column_stack([U, V]), "label": "u, v1"}
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": T, "signals": signals}})
    read(tmp_path / "a.mat")


def test_vector_signal_without_names(tmp_path):
    signals = {"values": np.column_stack([U, V]), "label": "mux"}
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": T, "signals": signals}})
    with pytest.raises(RecordingError, match=r"signal mux: each column .* needs a name; got shape \(301, 2\)"):
        read_table(tmp_path / "a.mat")


def test_structure_without_time(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"time": [], "signals": {"values": U, "label": "u"}}})
    with pytest.raises(RecordingError, match="struct S: its time must be a vector.*'Structure With Time'"):
        read_table(tmp_path / "a.mat")


def test_timeseries_structs(tmp_path):
    first, second = {"Time": T, "Data": U, "Name": "u"}, {"Time": T, "Data": V, "Name": ""}
    scipy.io.savemat(tmp_path / "a.mat", {"a": first, "v1": second})
    assert read(tmp_path / "a.mat").notes == ()


def test_signals_of_different_rates_are_joined_on_the_commands_time(tmp_path):
    slow = T[::4]
    ramp = {"Time": slow, "Data": 3.0 * slow, "Name": "x1"}
    scipy.io.savemat(tmp_path / "a.mat", {"b": ramp, "a": {"Time": T, "Data": U, "Name": "u"}})
    inside = slow[-1] >= T
    table = read(tmp_path / "a.mat", ("t_s", "u", "x1"), (T[inside], U[inside], 3.0 * T[inside]))
    assert table.notes == ("1 signals joined on one time base",)


def test_a_reference_of_another_rate_is_held(tmp_path):
    slow = T[::100]
    steps = {"Time": slow, "Data": np.arange(slow.size), "Name": "xr"}
    scipy.io.savemat(tmp_path / "a.mat", {"r": steps, "a": {"Time": T, "Data": U, "Name": "u"}})
    table = read_table(tmp_path / "a.mat")
    held = dict(zip(table.labels, table.values, strict=True))["xr"]
    assert set(held) == {0.0, 1.0, 2.0, 3.0}
    assert held[99] == 0.0
    assert held[100] == 1.0


def test_signals_of_different_runs_are_refused(tmp_path):
    late = {"Time": T + 9.0, "Data": V, "Name": "v1"}
    scipy.io.savemat(tmp_path / "a.mat", {"b": late, "a": {"Time": T, "Data": U, "Name": "u"}})
    with pytest.raises(RecordingError, match="all signals must cover a common span"):
        read_table(tmp_path / "a.mat")


@pytest.mark.parametrize("labels", [cells("t", "u", "v1"), np.array(["t", "u", "v1"])], ids=["cell", "char"])
def test_array_with_names_beside_it(tmp_path, labels):
    scipy.io.savemat(tmp_path / "a.mat", {"out": np.column_stack([T, U, V]), "labels": labels})
    read(tmp_path / "a.mat")


def test_array_without_names(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"out": np.column_stack([T, U, V])})
    with pytest.raises(RecordingError, match=r"matrix out: .* no list of 3 names. Save a cell array"):
        read_table(tmp_path / "a.mat")


def test_a_matrix_beside_complete_vectors_is_something_else(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "u": U, "v1": V, "A": np.eye(4)})
    read(tmp_path / "a.mat")


def test_file_without_signals(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"Kp": 3.0, "note": "hello"})
    with pytest.raises(RecordingError, match="must hold vectors.*got variables Kp, note.*save\\('run.mat'"):
        read_table(tmp_path / "a.mat")


@pytest.mark.parametrize("size", [0, 60, 200, 2000])
def test_truncated_file(tmp_path, size):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"t": T, "u": U, "v1": V})
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(RecordingError, match=r"a.mat: file: must be a complete MATLAB file.*'-v7'"):
        read_table(path)


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
            read_table(tmp_path / "a.mat")

    def test_truncated(self, file, tmp_path):
        self.number(file, "t", T)
        file.close()
        path = tmp_path / "a.mat"
        path.write_bytes(path.read_bytes()[:1500])
        with pytest.raises(RecordingError, match="must be a complete MATLAB file"):
            read_table(path)
