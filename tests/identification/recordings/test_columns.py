import re

import numpy as np
import pytest

from identification.recordings.columns import conversion, no_unit, read_label
from tests.each import each


@each(
    ("label", "signal", "factor"),
    [
        ("t", "t", 1.0),
        ("t_s", "t", 1.0),
        ("t [sec]", "t", 1.0),
        ("time", "t", 1.0),
        ("Time (s)", "t", 1.0),
        ("t / s", "t", 1.0),
        ("t_ms", "t", 1e-3),
        ("TIME [us]", "t", 1e-6),
        ("u", "u", 1.0),
        ("u_V", "u", 1.0),
        ("u [V]", "u", 1.0),
        ("U_mV", "u", 1e-3),
        ("voltage", "u", 1.0),
        ("command", "u", 1.0),
        ("input", "u", 1.0),
        ("x1_mm", "x1", 1.0),
        ("x1 (m)", "x1", 1000.0),
        ("x_1", "x1", 1.0),
        ("q_m", "x1", 1000.0),
        ("position", "x1", 1.0),
        ("position2", "x2", 1.0),
        ("Position 2 [cm]", "x2", 10.0),
        ("v1_mm_s", "v1", 1.0),
        ("v1 [mm/sec]", "v1", 1.0),
        ("v1 []", "v1", 1.0),
        ("v2_m_s", "v2", 1000.0),
        ("v2 [m s^-1]", "v2", 1000.0),
        ("velocity1", "v1", 1.0),
        ("cart2 velocity [cm/s]", "v2", 10.0),
        ("Motor Position [cm]", "x1", 10.0),
        ("load_position", "x2", 1.0),
        ("Load Speed (m/s)", "v2", 1000.0),
        ("motor_encoder", "x1", 1.0),
        ("xr", "xr", 1.0),
        ("ref", "xr", 1.0),
        ("reference", "xr", 1.0),
        ("x1_ref", "xr", 1.0),
        ("qref_m", "xr", 1000.0),
    ],
)
def test_names_and_units_that_labs_use(label, signal, factor):
    column = read_label(label)
    assert column is not None
    assert (column.signal, column.factor) == (signal, factor)


@each(
    "label", ["y_V", "v", "x3", "temperature [C]", "", "flag", "motor", "load", "motor current [A]", "load 3 position"]
)
def test_other_names_are_unknown(label):
    assert read_label(label) is None


def test_ms_is_a_millisecond_of_time_but_a_metre_per_second_of_velocity():
    assert read_label("t [ms]").factor == 1e-3
    assert read_label("v1 [ms]").factor == 1000.0


def refused(label):
    column = read_label(label)
    assert np.isnan(column.factor)
    return str(no_unit("log.csv", label, column.signal, column.unit))


def test_unknown_unit_of_a_known_signal_is_refused():
    assert re.search(r"log.csv: column v1 \[ticks/s\]: the unit .* mm/s; got ticks/s", refused("v1 [ticks/s]"))


@each(
    ("label", "signal", "origin", "factor"),
    [
        ("t_exp", "t", "measured", 1.0),
        ("uexp", "u", "measured", 1.0),
        ("x1exp [mm]", "x1", "measured", 1.0),
        ("v1_raw", "v1", "measured", 1.0),
        ("x2_meas_m", "x2", "measured", 1000.0),
        ("Measured Position [mm]", "x1", "measured", 1.0),
        ("v1_filt", "v1", "filtered", 1.0),
        ("v2_mm_s_filtered", "v2", "filtered", 1.0),
        ("ScopeData_v1_filt", "v1", "filtered", 1.0),
        ("ScopeData_x2", "x2", "plain", 1.0),
        ("x1_sim", "x1", "simulated", 1.0),
        ("sim_x1", "x1", "simulated", 1.0),
        ("v2 model", "v2", "simulated", 1.0),
        ("Encoder 1 Pos", "x1", "plain", 1.0),
        ("enc2", "x2", "plain", 1.0),
        ("Control Effort", "u", "plain", 1.0),
    ],
)
def test_words_that_say_whence_a_signal_comes(label, signal, origin, factor):
    column = read_label(label)
    assert column is not None
    assert (column.signal, column.origin, column.factor) == (signal, origin, factor)


@each("label", ["test", "temp", "timeout", "exp", "data", "simout", "x1exp2", "raw"])
def test_words_that_only_look_like_that(label):
    assert read_label(label) is None


@each(
    ("label", "wanted", "factor"),
    [
        ("x1 [deg]", "rad", 3.141592653589793 / 180.0),
        ("pos_deg", "deg", 1.0),
        ("v1 [rpm]", "rad/s", 3.141592653589793 / 30.0),
        ("x1_m", "mm", 1000.0),
        ("x1", "rad", 1.0),
        ("u [mN m]", "N m", 1e-3),
        ("x1 [deg]", "mm", None),
    ],
)
def test_a_unit_is_converted_to_the_rigs_where_both_measure_the_same(label, wanted, factor):
    found = conversion(read_label(label), wanted)
    assert found == (None if factor is None else pytest.approx(factor))


def test_a_foreign_unit_says_what_to_write():
    assert re.search(r"got rad. .* rig.toml .*: \[units\] x1 = \{ unit = \"rad\" \}", refused("x1_rad"))
