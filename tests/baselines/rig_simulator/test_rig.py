"""The blind rig against independent calculations: the package's drive, closed formulas, energy, symmetry."""

import math
import subprocess
import sys

import numpy as np
import pytest

from baselines.rig_simulator.kernel import COUNT_MM, _stack
from baselines.rig_simulator.recordings import trajectory
from baselines.rig_simulator.rig import Disturbances, p_law, quiet, run, vector
from tests.each import each

VALUES = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 9.5e-3, "b2": 3.2e-3, "k": 0.096, "d1": 0.36, "d2": 0.25}
T = np.arange(4001) * 1e-3


def square(amplitude=2.0, frequency=0.5):
    return np.where(np.mod(T * frequency + 1e-9, 1.0) < 0.5, amplitude, -amplitude)


def sine(frequency, amplitude=2.5):
    return amplitude * np.sin(2 * np.pi * frequency * T)


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def backward(x):
    return np.diff(x, prepend=x[0]) * 1e3


def test_the_generator_stands_alone():
    code = (
        "import sys, baselines.rig_simulator.make, baselines.rig_simulator.calibrate\n"
        "foreign = [m for m in sys.modules if m.split('.')[0] in ('flexdrive_gym', 'identification', 'gymnasium')]\n"
        "assert not foreign, foreign"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@each("command", [square(), square(1.5), sine(0.5), sine(3.0), sine(5.0)], ids=["2V", "1.5V", "0.5Hz", "3Hz", "5Hz"])
def test_without_effects_it_is_the_handouts_drive(command):
    from flexdrive_gym import Drive

    ours, theirs = run(VALUES, quiet(len(T)), command), Drive(VALUES).simulate(T, command)
    assert rms(backward(ours.states[0]) - theirs.v1) < 0.002 * rms(theirs.v1)
    assert rms(backward(ours.states[2]) - theirs.v2) < 0.002 * rms(theirs.v2)


def test_the_loop_is_the_handouts_p_control():
    from flexdrive_gym import Drive, PControl

    xr = trajectory(T)
    ours = run(VALUES, quiet(len(T)), xr, controller=p_law(0.05))
    theirs = Drive(VALUES).simulate_closed_loop(T, xr, PControl(0.05, "x2"))
    assert rms(COUNT_MM * ours.counts[1] - theirs.x2) < 0.005 * rms(theirs.x2)
    assert np.allclose(ours.u, np.clip(0.05 * (xr - COUNT_MM * ours.counts[1]), -8, 8), atol=1e-12)


def test_the_fine_step_is_fine_enough():
    coarse, fine = (run(VALUES, quiet(len(T)), sine(2.5), steps=n).states[3] for n in (50, 200))
    assert rms(coarse - fine) < 0.002 * rms(fine)


def test_a_long_step_ends_at_the_handouts_steady_velocity():
    # Eq. (3): vss = (u0 - d1 - d2)/(b1 + b2)
    motion = run(VALUES, quiet(len(T)), np.full(len(T), 2.0))
    vss = (2.0 - 0.36 - 0.25) / (9.5e-3 + 3.2e-3)
    assert motion.states[[1, 3], -1] == pytest.approx([vss, vss], rel=1e-3)


def released(values, deflection):
    s = quiet(len(T))
    return run(values, Disturbances(s.over_time, s.track, 0.0, deflection), np.zeros(len(T)))


def test_without_friction_energy_stays_and_the_frequency_is_the_springs():
    free = {"m1": 7.6e-4, "m2": 3.4e-4, "k": 0.096}
    x1, v1, x2, v2 = released(free, 10.0).states
    energy = 0.5 * (free["m1"] * v1**2 + free["m2"] * v2**2 + free["k"] * (x1 - x2) ** 2)
    assert energy == pytest.approx(np.full(len(T), 0.5 * free["k"] * 100.0), rel=2e-3)
    assert rms(free["m1"] * v1 + free["m2"] * v2) < 1e-9, "nothing pushes from outside, so momentum stays zero"
    omega = math.sqrt(free["k"] * (1 / free["m1"] + 1 / free["m2"]))
    assert x1 - x2 == pytest.approx(10.0 * np.cos(omega * T), abs=0.02)


@each("contact", [{}, {"bristle1": 0.5}], ids=["rigid", "bristles"])
def test_one_sided_dry_friction_is_there_with_either_contact(contact):
    values = {**VALUES, **contact, "d_skew1": 0.4}
    fast, slow = (run(values, quiet(len(T)), np.full(len(T), side * 2.0)).states[1][-1] for side in (-1.0, 1.0))
    b, d1, d2 = VALUES["b1"] + VALUES["b2"], VALUES["d1"], VALUES["d2"]
    assert -b * fast == pytest.approx(2.0 - 0.6 * d1 - d2, rel=0.01)
    assert b * slow == pytest.approx(2.0 - 1.4 * d1 - d2, rel=0.01)


@each("extra", [{}, {"static1": 0.3}, {"hump2": 0.4}, {"load1": 0.1}], ids=str)
def test_within_the_friction_band_nothing_ever_creeps(extra):
    states = released(VALUES | extra, 0.95 * 0.25 / 0.096).states
    assert np.all(states[[1, 3]] == 0.0)


def test_bristles_give_way_and_come_back():
    # a push below the level displaces by about force over stiffness, holds, and mostly springs back
    push = np.where(T < 2.0, 0.2, 0.0)
    x1 = run({**VALUES, "k": 0.0, "bristle1": 1.0}, quiet(len(T)), push).states[0]
    assert 0.2 < x1[1990] < 0.4
    assert x1[1990] == pytest.approx(x1[1500], abs=1e-3)
    assert 0.15 < x1[1990] - x1[-1] < 0.3


ODD = {
    "stribeck": {"hump1": 0.5, "hump2": 0.5},
    "breakaway": {"static1": 0.5},
    "presliding": {"bristle2": 0.5},
    "drag": {"drag1": 2e-5},
    "load": {"load2": 0.05},
    "hardening": {"bend": 0.06},
    "gap": {"gap": 0.4},
    "bind": {"bind_at": 5.0, "bind_k": 0.03},
    "damper": {"damper": 1e-3},
    "hysteresis": {"slip_k": 0.02, "slip_at": 3.0},
    "notch": {"notch": 0.2},
    "ceiling": {"ceiling": 2.4},
    "wait": {"wait": 0.003},
    "lag": {"lag": 0.004},
    "lash": {"rotor": 0.4, "lash": 0.1},
    "tail": {"tail_m": 3e-5, "tail_k": 0.1, "tail_b": 1e-4},
    "play": {"play1": 0.2},
    "mutual": {"mutual": 5e-5},
    "belt": {"rotor": 0.4, "belt": 1.5},
}
EVEN = {
    "d_skew": {"d_skew1": 0.1},
    "b_skew": {"b_skew2": 0.2},
    "k_skew": {"k_skew": 0.2},
    "gain_skew": {"gain_skew": 0.03},
    "offset": {"offset": 0.05},
}


@each("extra", ODD.values(), ids=ODD)
def test_odd_physics_mirrors_with_the_command(extra):
    there, back = (run(VALUES | extra, quiet(len(T)), s * sine(3.0)).shown for s in (1.0, -1.0))
    assert there == pytest.approx(-back, abs=1e-6)


@each("extra", EVEN.values(), ids=EVEN)
def test_even_physics_does_not(extra):
    there, back = (run(VALUES | extra, quiet(len(T)), s * sine(3.0)).shown for s in (1.0, -1.0))
    assert np.max(np.abs(there + back)) > 0.5


def test_a_delay_delays_and_does_nothing_else():
    late = run(VALUES | {"wait": 0.005}, quiet(len(T)), sine(2.0)).states
    now = run(VALUES, quiet(len(T)), sine(2.0)).states
    assert late[1, 5:] == pytest.approx(now[1, :-5], abs=1e-6)
    seen = run(VALUES | {"late2": 0.005}, quiet(len(T)), sine(2.0)).shown
    assert seen[1, 5:] == pytest.approx(now[2, :-5], abs=1e-6)


def test_a_dead_zone_swallows_small_commands_and_a_ceiling_large_ones():
    still = run(VALUES | {"d1": 0.0, "d2": 0.0, "notch": 0.5}, quiet(len(T)), np.full(len(T), 0.2))
    assert abs(still.states[1, -1]) < 0.02 * 0.2 / (9.5e-3 + 3.2e-3)
    capped = run(VALUES | {"ceiling": 2.0, "sharp": 10.0}, quiet(len(T)), np.full(len(T), 7.0))
    assert capped.states[1, -1] == pytest.approx((2.0 - 0.61) / 12.7e-3, rel=0.01)


def test_play_holds_the_reading_until_it_is_crossed():
    g = 0.3
    motion = run(VALUES | {"play1": g}, quiet(len(T)), sine(1.0))
    x, y = motion.states[0], motion.shown[0]
    assert np.max(np.abs(x - y)) == pytest.approx(g, abs=0.02)
    top = int(np.argmax(x[:1000]))
    crossed = top + int(np.argmax(x[top:] < x[top] - 2 * g))
    assert np.ptp(y[top : crossed - 2]) < 1e-3
    assert np.ptp(y[top : crossed + 60]) > 1e-1


def test_the_spring_loses_per_cycle_what_its_sliders_say():

    p = vector({**VALUES, "slip_k": 0.02, "slip_at": 2.0})

    def loss(n):
        sliders, total, previous = np.zeros(8), 0.0, 0.0
        for delta in 6.0 * np.sin(np.linspace(0.0, 4 * np.pi, 2 * n)):
            force = _stack(float(delta), sliders, p)
            total, previous = total + force * (delta - previous), float(delta)
        return total / 2

    assert loss(4000) == pytest.approx(loss(16000), rel=0.01), "dry loss knows no frequency"
    # a Jenkins element of stiffness c slipping at r loses 4·c·r·(A - r) per cycle of amplitude A; the first cycle's
    # virgin branch costs less
    reach = 2.0 * (np.arange(8) + 1) / 8
    assert loss(16000) == pytest.approx(np.sum(4 * 0.02 / 8 * reach * (6.0 - reach)), rel=0.06)


def test_an_appendage_rings_at_its_own_frequency():
    tail = {"tail_m": 4e-5, "tail_k": 4e-5 * (2 * np.pi * 9.0) ** 2, "tail_b": 0.0, "tail_on": 2.0}
    free = {"m1": 1e3, "m2": 1e-2, "k": 0.0}  # a heavy cart 2 hardly moves
    kick = quiet(len(T))
    kick.over_time[5, :5] = 50.0
    v2 = run(free | tail, kick, np.zeros(len(T))).states[3]
    line = np.abs(np.fft.rfft((v2 - v2.mean())[10:]))
    f = np.fft.rfftfreq(len(v2) - 10, 1e-3)
    assert f[np.argmax(line)] == pytest.approx(9.0, abs=0.3)


def test_an_unknown_number_is_refused():
    with pytest.raises(KeyError, match="no number called 'm3'"):
        run({**VALUES, "m3": 1.0}, quiet(10), np.zeros(10))
