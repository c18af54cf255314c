import numpy as np
import pytest

from flexdrive_gym.units import LAB, Units
from identification.recordings import RecordingError
from identification.recordings.checks import check_excitation, check_units, scale_warnings
from tests.each import each
from tests.identification.recordings.logs import COUNT, TS, open_loop, speed, velocity_log

T, U, X1, X2 = open_loop()
V1, V2 = speed(X1), speed(X2)


def check(quantum=None, **signals):
    check_units({"u": U, **signals}, quantum or {}, TS, "log.csv")


def test_a_run_of_the_rig_passes():
    check(v1=V1, v2=V2, x1=X1, x2=X2, xr=np.linspace(0.0, 50.0, T.size))


def test_a_cart_that_friction_holds_passes():
    check(v1=np.zeros(T.size), v2=np.zeros(T.size))


def test_an_ideal_second_cart_under_a_fast_sine_passes():
    check(v1=V1, v2=0.3 * np.sin(125.0 * T))


def test_a_few_counts_of_motion_pass():
    log = velocity_log("sine", 2.5, 20.0, 1.0)
    integral = np.cumsum(log["v2_mm_s"]) * TS
    check_units({"u": log["u_V"], "v2": log["v2_mm_s"], "x2": integral}, {"v2": COUNT / TS}, TS, "log.csv")


def test_metres_per_second_labelled_millimetres():
    with pytest.raises(RecordingError, match=r"column v1: a cart .* 0.5 mm/s; got at most .* rename it v1_m_s"):
        check(v1=1e-3 * V1)
    with pytest.raises(RecordingError, match="rename it v2_m_s"):
        check(v1=V1, v2=1e-3 * V2, quantum={"v2": 1e-3 * COUNT / TS})


def test_micrometres_per_second_labelled_millimetres():
    with pytest.raises(RecordingError, match=r"column v1: \|v1\| must stay below 10000 mm/s"):
        check(v1=1e3 * V1)


@each("amplitude", [0.55, 0.6, 2.0])
def test_micrometres_per_second_of_a_slow_cart(amplitude):
    # a cart that creeps count by count is too fast in single samples only, but the others are too fast as well
    log = velocity_log("sine", amplitude, 1.0)
    with pytest.raises(RecordingError, match=r"column v1: \|v1\| must stay below 10000 mm/s"):
        check(v1=1e3 * log["v1_mm_s"])


def test_a_single_leap_of_an_encoder_is_no_wrong_unit():
    leap = V1.copy()
    leap[2600] = 3e4
    check(v1=leap)
    filtered = V1.copy()
    filtered[2600:2620] += 3e4 * 0.7 ** np.arange(20)
    check(v1=filtered)


def test_leaps_all_over_a_channel_are():
    leaps = V1.copy()
    leaps[::50] = 3e4
    with pytest.raises(RecordingError, match="single leaps"):
        check(v1=leaps)


def test_metres_labelled_millimetres():
    small = 1e-3 * X1
    with pytest.raises(RecordingError, match="column x1: positions must .* rename it x1_m"):
        check(x1=small, quantum={"x1": 1e-3 * COUNT})


def test_micrometres_labelled_millimetres():
    with pytest.raises(RecordingError, match=r"\|x2\| must stay below 5000 mm; .* x2_um"):
        check(x2=1e3 * X1)


@each("factor", [10.0, 0.1, 1e-3])
def test_velocity_that_disagrees_with_position(factor):
    with pytest.raises(RecordingError, match=r"column v2: its integral must agree with x2; .*v2_m_s or x2_m"):
        check(v2=V2, x2=factor * X2)


def test_position_in_metres_beside_velocity_in_millimetres_names_the_factor():
    with pytest.raises(RecordingError, match="a factor of 1e"):
        check(v1=V1, x1=1e-3 * X1)


def test_reference_in_metres_beside_positions_in_millimetres():
    with pytest.raises(RecordingError, match="column xr: reference and positions .* xr_m"):
        check(x1=X1, xr=np.linspace(0.0, 0.05, T.size))


def test_millivolts_labelled_volts():
    with pytest.raises(RecordingError, match=r"column u: \|u\| must stay below 100 V; got 2000 V.*u_mV"):
        check_units({"u": 1e3 * U, "v1": V1}, {}, TS, "log.csv")


def test_missing_values_do_not_disturb_the_checks():
    holes = V1.copy()
    holes[::50] = np.nan
    check(v1=holes, x1=X1)


def test_a_silent_command_is_refused_only_where_nothing_moves():
    with pytest.raises(RecordingError, match="column u: the drive must be excited; got u is constant"):
        check_excitation(np.zeros(100), False, LAB, "log.csv")
    assert "plucked by hand" in check_excitation(np.zeros(100), True, LAB, "log.csv")[0]


def test_a_constant_command_is_a_step_worth_a_note():
    assert check_excitation(np.full(100, 1.5), True, LAB, "log.csv") == ("u is constant at 1.5 V",)
    assert check_excitation(U, True, LAB, "log.csv") == ()
    torque = Units("rad", "N m", 10.0, 100.0)
    assert check_excitation(np.full(100, 1.5), True, torque, "log.csv") == ("u is constant at 0.015 N m",)


def warnings(quantum=None, units=LAB, **signals):
    return scale_warnings({"u": U, **signals}, quantum or {}, TS, units)


def test_a_run_of_the_rig_warns_of_nothing():
    assert warnings({"x1": COUNT, "v1": COUNT / TS}, v1=V1, v2=V2, x1=X1, x2=X2) == ()
    slow = velocity_log("sine", 2.5, 20.0, 1.0)
    assert scale_warnings({"u": slow["u_V"], "v1": slow["v1_mm_s"]}, {}, TS) == ()


@each(
    ("signals", "said"),
    [
        ({"x1": 1e3 * X1}, "x1 moves in steps of 4.66 mm: are these an encoder's counts"),
        ({"x1": 1e-3 * X1}, "the carts move at"),
        ({"x1": X1, "x2": 1e-3 * X2}, "are x1 and x2 in the same unit"),
        ({"v1": 1e-3 * V1}, "slow for a laboratory drive"),
        ({"v1": 1e3 * V1}, "fast for a laboratory drive"),
        ({"u": 1e-3 * U, "v1": V1}, "is u in another unit than V"),
    ],
)
def test_what_is_a_thousand_times_off_is_warned_of(signals, said):
    quantum = {name: COUNT * abs(np.ptp(values) / np.ptp(X1)) for name, values in signals.items() if name[0] == "x"}
    found = warnings(quantum, **signals)
    assert any(said in text and text.startswith("warning: ") for text in found)


def test_bounds_of_the_lab_do_not_hold_for_a_rig_with_units_of_its_own():
    torque = Units("rad", "N m", 1.0, 100.0)
    check_units({"u": 200.0 * U, "x1": 1e3 * X1}, {}, TS, "log.csv", torque)
    assert warnings({"x1": 0.5}, torque, x1=X1) == ()
