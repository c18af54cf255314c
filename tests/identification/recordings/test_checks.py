import numpy as np
import pytest

from identification.recordings import RecordingError
from identification.recordings.checks import check_excitation, check_units
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


@pytest.mark.parametrize("amplitude", [0.55, 0.6, 2.0])
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


@pytest.mark.parametrize("factor", [10.0, 0.1, 1e-3])
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


def test_silent_command_is_refused():
    with pytest.raises(RecordingError, match="column u: the drive must be excited; got u is constant"):
        check_excitation(np.zeros(100), "log.csv")


def test_a_constant_command_is_a_step_worth_a_note():
    assert check_excitation(np.full(100, 1.5), "log.csv") == ("u is constant at 1.5 V",)
    assert check_excitation(U, "log.csv") == ()
