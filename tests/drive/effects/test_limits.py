"""Limits and closed forms: what each effect must do, from its equation by hand."""

import numpy as np
import pytest

from flexdrive_gym import Drive
from flexdrive_gym.references import sine
from tests.drive.drives import FRICTIONLESS, RIG
from tests.drive.effects.runs import H, instants, states
from tests.each import each

D1, D2, K = RIG["d1"], RIG["d2"], RIG["k"]
RIGID = {"m1": 1.1e-3, "b1": 0.0127, "d1": 0.6}


@each(
    "extra",
    [
        {"breakaway.cart_1.extra": 0.1},
        {"stribeck.cart_1.extra": 0.1},
        {"coulomb_asymmetry.cart_1.a": 0.1},
        {"dead_zone.uz": 0.1},
        {"input_offset.u0": -0.1},
    ],
)
def test_a_cart_holds_exactly_up_to_its_level(extra):
    for factor, moves in ((1 - 1e-9, False), (1 + 1e-9, True)):
        u = np.full(5, (D1 + 0.1) * factor)
        assert np.any(states({**RIG, **extra}, u)[1] > 0.0) == moves


def test_load_friction_holds_a_cart_against_a_stronger_spring():
    # the spring k·δ presses with μ·k·δ: cart 2 lets go at k·δ = d2/(1 - μ)
    reach = D2 / K / (1 - 0.05)
    for factor, moves in ((1 - 1e-9, False), (1 + 1e-9, True)):
        values = {**RIG, "load_friction.cart_2.mu": 0.05}
        v2 = states(values, np.zeros(3), start=(factor * reach, 0.0, 0.0, 0.0))[3]
        assert np.any(v2 > 0.0) == moves


@each(("v", "level"), [(5.0, 0.6 + 0.2 * np.exp(-(5.0**2) / 30.0**2)), (300.0, 0.6)])
def test_stribeck_level_while_sliding(v, level):
    values = {**RIGID, "stribeck.cart_1.extra": 0.2, "stribeck.cart_1.vs": 30.0}
    h = 1e-6
    v1 = states(values, np.zeros(2), h=h, start=(0.0, v, 0.0, 0.0))[1]
    force = -(v1[1] - v1[0]) / h * RIGID["m1"] - RIGID["b1"] * v
    assert force == pytest.approx(level, rel=1e-4)


def test_steady_velocities_follow_the_law_of_friction():
    # rigid: u = d(s) + b(s)·v + c·v·|v|
    values = {
        **RIGID, "coulomb_asymmetry.cart_1.a": 0.05, "viscous_asymmetry.cart_1.a": 1e-3, "quadratic_drag.cart_1.c": 1e-5,
    }  # fmt: skip
    for s in (1.0, -1.0):
        v = states(values, np.full(3001, s * 2.0))[1, -1]
        assert np.sign(v) == s
        assert 0.6 + 0.05 * s + (0.0127 + 1e-3 * s) * abs(v) + 1e-5 * v * v == pytest.approx(2.0, rel=1e-9)


def test_friction_drifts_with_time():
    values = {**RIGID, "friction_drift.cart_1.rate": 0.02}
    u, n = 2.0, 8000
    v = states(values, np.full(n + 1, u))[1]
    # quasi-static at the end: u = (d + b·v)(1 + rate·t) + m·dv/dt
    slope = (v[-1] - v[-101]) / (100 * H)
    assert u == pytest.approx((0.6 + 0.0127 * v[-1]) * (1 + 0.02 * n * H) + 1.1e-3 * slope, rel=1e-4)


def test_a_sum_of_gain_offset_and_dead_zone_in_the_documented_order():
    # limit, dead zone, gain, offset: ((3 → 2) - 0.5)·(1 + 0.1)·(1 + 0·t) + 0.2
    values = {
        **RIGID, "saturation.limit": 2.0, "dead_zone.uz": 0.5, "gain_asymmetry.a": 0.1, "input_offset.u0": 0.2,
    }  # fmt: skip
    force = (2.0 - 0.5) * 1.1 + 0.2
    assert states(values, np.full(3001, 3.0))[1, -1] == pytest.approx((force - 0.6) / 0.0127, rel=1e-9)
    drifting = states({**RIGID, "gain_drift.rate": -0.01}, np.full(3001, 3.0))[1]
    later = states(RIGID, np.full(3001, 3.0))[1]
    assert drifting[-1] == pytest.approx(later[-1] - 3.0 * 0.01 * (3.0 - 1.1e-3 / 0.0127) / 0.0127, rel=1e-4)


@each("s", [1e-9, 0.5, 4.0])
def test_a_gain_that_drifts_settles(s):
    # from rest m·v' + b·v = gain·u - d, with a gain that ends at 1 + rate/s
    t = instants(3.0)
    v = states({**RIGID, "gain_drift.rate": -0.05, "gain_drift.s": s}, np.full(len(t), 3.0))[1]
    gain = 1.0 - 0.05 * (t if s < 1e-6 else (1.0 - np.exp(-s * t)) / s)
    lag = 1.1e-3 / 0.0127
    slope = -0.05 * np.exp(-s * t)
    steady = (3.0 * gain - 0.6) / 0.0127
    # to first order in the lag of the cart, long after the start
    assert v[-1] == pytest.approx(steady[-1] - 3.0 * slope[-1] * lag / 0.0127, rel=1e-3)


@each(("way", "force"), [(2.0, 2.0 * (2.0 / 10.0) ** 0.5), (5.0, 5.0 * 0.5**0.5)])
def test_the_stiffness_of_a_contact_grows_with_the_way(way, force):
    values = {**FRICTIONLESS, "coil_bind.kb": 0.1, "coil_bind.d0": 10.0, "coil_bind.n": 0.5}
    v2 = states(values, np.zeros(2), h=1e-6, start=(10.0 + way, 0.0, 0.0, 0.0))[3, 1]
    assert v2 / 1e-6 * RIG["m2"] == pytest.approx((10.0 + way) * K + 0.1 * force, rel=1e-5)


@each(("rate", "factor"), [(100.0, 1.1), (-100.0, 0.9), (-2000.0, 0.0)])
def test_a_contact_pushes_less_while_it_is_let_go_and_never_pulls(rate, factor):
    values = {**FRICTIONLESS, "coupling_backlash.g": 2.0, "coupling_backlash.loss": 1e-3}
    free = {k: v for k, v in values.items() if not k.startswith("b")}
    v2 = states({**free, "b1": 0.0, "b2": 0.0}, np.zeros(2), h=1e-6, start=(5.0, rate, 0.0, 0.0))[3, 1]
    assert v2 / 1e-6 * RIG["m2"] == pytest.approx(3.0 * K * factor, rel=1e-3, abs=1e-9)


@each("softness", [1e-4, 1e-2])
def test_a_limit_that_is_nearly_hard_is_the_hard_limit(softness):
    # (8 / 2) to the power of 10,000 is no number
    values = {**RIGID, "saturation.limit": 2.0, "saturation.softness": softness}
    found = [states(values, np.full(3001, u))[1, -1] for u in (8.0, -8.0, 1.5)]
    hard = [states({**RIGID, "saturation.limit": 2.0}, np.full(3001, u))[1, -1] for u in (8.0, -8.0, 1.5)]
    assert found == pytest.approx(hard, rel=1e-4)


@each("softness", [0.1, 0.75])
def test_soft_limit_passes_small_commands_and_ends_at_the_limit(softness):
    values = {**RIGID, "saturation.limit": 2.0, "saturation.softness": softness}

    def force(u):
        return 0.6 + 0.0127 * states(values, np.full(3001, u))[1, -1]

    assert force(2.0) == pytest.approx(2.0 * 2.0**-softness, rel=1e-6)
    assert force(1e4) == pytest.approx(2.0, rel=1e-2)
    if softness == 0.1:
        assert force(1.0) == pytest.approx(1.0, rel=1e-3)


@each("tau", [1e-4, 2e-3, 6e-3])
def test_lag_is_a_first_order_step_response(tau):
    # without friction m·v = ∫u: the lagged step has the impulse t - τ·(1 - exp(-t/τ))
    t = instants(0.05)
    v = states({"m1": 1.1e-3, "amplifier_lag.tau": tau}, np.ones(len(t)))[1]
    expected = (t - tau * (1 - np.exp(-t / tau))) / 1.1e-3
    assert np.abs(v - expected).max() < (1e-2 if tau == 1e-4 else 1e-4) * tau / 1.1e-3


def test_lag_and_delay_together():
    # a lag behind a delay of a sample and a half is the lagged response, later
    tau = 3e-3
    fine = 5e-4
    u = np.concatenate([np.zeros(20), np.ones(81)])
    rigid = {"m1": 1.1e-3, "amplifier_lag.tau": tau}
    late = states({**rigid, "input_delay.tau": 1.5 * H}, u)[1]
    lagged = states(rigid, np.repeat(u, 2), h=fine)[1]
    assert np.allclose(late[2:], lagged[1:-4:2][: len(late) - 2], atol=1e-6)


def test_backlash_leaves_the_carts_alone_inside():
    values = {**FRICTIONLESS, "coupling_backlash.g": 2.0, "C": 1e-3}
    _x1, v1, _x2, v2 = states(values, np.zeros(101), start=(1.9, 0.0, 0.0, 0.0))
    assert np.all(v1 == 0.0)
    assert np.all(v2 == 0.0)
    pulled = states(values, np.zeros(2), h=1e-6, start=(5.0, 0.0, 0.0, 0.0))[3, 1] / 1e-6 * RIG["m2"]
    assert pulled == pytest.approx(K * 3.0, rel=1e-4)


@each(("delta", "force"), [(8.0, 8.0 * K), (12.0, 12.0 * K + 2.0 * 0.1), (-12.0, -12.0 * K - 0.2)])
def test_coils_touch_beyond_their_deflection(delta, force):
    values = {**FRICTIONLESS, "coil_bind.kb": 0.1, "coil_bind.d0": 10.0}
    v2 = states(values, np.zeros(2), h=1e-6, start=(delta, 0.0, 0.0, 0.0))[3, 1]
    assert v2 / 1e-6 * RIG["m2"] == pytest.approx(force, rel=1e-5)


@each("frequency", [0.5, 2.0])
def test_hysteresis_loses_the_same_at_every_speed(frequency):
    # cart 2 is too heavy to move, cart 1 is shaken; the loop's area is level·(4A - 5xs)
    level, xs = 0.2, 0.5
    values = {"m1": 1e-4, "b1": 0.0, "m2": 1e3, "k": 2.0, "spring_hysteresis.level": level, "spring_hysteresis.xs": xs}
    n = round(1.0 / frequency / H)
    t = np.arange(4 * n + 1) * H
    u = 24.0 * np.sin(2 * np.pi * frequency * t)
    x1, v1, _x2, _v2 = states({**values, "b1": 2e-3}, u, physics_step=2.5e-4)
    last = slice(-n - 1, None)
    work = np.sum(u[last][:-1] * np.diff(x1[last]))
    viscous = 2e-3 * np.sum(v1[last][:-1] ** 2) * H
    amplitude = 0.5 * np.ptp(x1[last])
    assert work - viscous == pytest.approx(level * (4 * amplitude - 5 * xs), rel=0.05)


def test_presliding_is_a_spring_for_small_forces():
    # d = 0: a force u below the level comes to rest where fd·(1 - exp(-x/xs)) = u, and goes back when it is taken away
    fd, xs = 0.3, 0.5
    values = {"m1": 1.1e-3, "b1": 0.1, "presliding.cart_1.fd": fd, "presliding.cart_1.xs": xs}
    slow = np.concatenate(
        [np.linspace(0.0, 0.05, 8000), np.full(4000, 0.05), np.linspace(0.05, 0.0, 8000), np.zeros(4000)]
    )
    x = states(values, slow)[0]
    assert x[11999] == pytest.approx(-xs * np.log(1 - 0.05 / fd), rel=1e-3)
    # on the way back ζ falls along -xs + (ζ0 + xs)·exp(Δx/xs): what is left is of second order in u/fd
    assert x[-1] == pytest.approx(-xs * np.log(1 - (0.05 / fd) ** 2), rel=1e-2)
    # beyond the level it slides for good
    assert states(values, np.full(12001, 0.4))[1, -1] == pytest.approx((0.4 - fd) / 0.1, rel=1e-6)


@each("xs", [0.02, 0.3])
def test_presliding_is_stable_at_any_speed(xs):
    values = {**RIG, "presliding.cart_1.fd": 0.3, "presliding.cart_1.xs": xs, "d1": 0.0}
    u = 4.0 * np.where(instants(2.0) % 0.5 < 0.25, 1.0, -1.0)
    coarse, fine = states(values, u), states(values, u, physics_step=1e-4)
    assert np.abs(coarse[1]).max() > 150.0
    assert np.abs(coarse - fine)[[1, 3]].max() < 2e-3 * np.abs(fine[[1, 3]]).max()
    # steady sliding against the level
    rigid = {**RIGID, "d1": 0.3, "presliding.cart_1.fd": 0.3, "presliding.cart_1.xs": xs}
    assert states(rigid, np.full(3001, 2.0))[1, -1] == pytest.approx((2.0 - 0.6) / 0.0127, rel=1e-6)


def test_cogging_repeats_along_the_way():
    # thrown without friction, the speed depends on the place alone: v² - v0² = 2/m·∫F dx
    m, a, period, v0 = 1.1e-3, 0.2, 8.0, 100.0
    values = {"m1": m, "cogging.a_sin": a, "cogging.P": period}
    x, v, _x2, _v2 = states(values, np.zeros(1001), start=(0.0, v0, 0.0, 0.0))
    expected = np.sqrt(v0**2 + 2 / m * a * period / (2 * np.pi) * (1 - np.cos(2 * np.pi * x / period)))
    assert np.ptp(v) > 3.0
    assert np.allclose(v, expected, rtol=1e-6)


def test_friction_of_a_place_holds_there():
    # d(x) = d + a·cos(2πx/P): at x = 0 the level is d + a, half a period on d - a
    values = {**RIGID, "position_friction.cart_1.a_cos": 0.1, "position_friction.cart_1.P": 80.0}
    for x, level in ((0.0, 0.7), (40.0, 0.5), (80.0, 0.7)):
        for factor, moves in ((1 - 1e-9, False), (1 + 1e-9, True)):
            v = states(values, np.full(4, level * factor), start=(x, 0.0, 0.0, 0.0))[1]
            assert np.any(v > 0.0) == moves


def test_tilt_is_an_offset_on_the_centre_of_mass():
    rig = {**FRICTIONLESS, "b1": 0.0, "b2": 0.0}
    t = instants(1.0)
    x1, _v1, x2, _v2 = states({**rig, "tilt.F": 0.05}, np.zeros(len(t)))
    total = rig["m1"] + rig["m2"]
    assert np.allclose(x1, 0.5 * 0.05 / total * t**2, atol=1e-8)  # both fall alike, so the spring stays slack
    assert np.allclose(x2, x1, atol=1e-8)


def test_ground_spring_swings_about_the_zero_of_the_run():
    m, kg = 1.1e-3, 0.02
    t = instants(3.0)
    x = states({"m1": m, "ground_spring.kg": kg}, np.zeros(len(t)), start=(10.0, 0.0, 0.0, 0.0))[0]
    assert np.allclose(x, 10.0 * np.cos(np.sqrt(kg / m) * t), atol=1e-6)


def test_appendage_has_the_frequencies_of_the_three_masses():
    own = 6e-5
    frequency, ma = 14.0, 2 * np.pi * 14.0
    rig = {"m1": 7.6e-4, "m2": 3.4e-4, "k": K}
    values = {**rig, "extra_mode.mass_2": own, "extra_mode.frequency": frequency, "extra_mode.zeta": 0.0}
    mass = np.diag([rig["m1"], rig["m2"], own])
    ka = own * ma**2
    stiffness = np.array([[K, -K, 0.0], [-K, K + ka, -ka], [0.0, -ka, ka]])
    expected = np.sort(np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))))[1:]
    # released from a stretched spring: v2 is a sum of the two modes; fit both frequencies at once
    t = instants(2.0)
    v2 = states(values, np.zeros(len(t)), start=(5.0, 0.0, 0.0, 0.0), physics_step=2.5e-4)[3]

    def misfit(w):
        basis = np.column_stack([f(x * t) for x in w for f in (np.sin, np.cos)])
        return np.linalg.norm(v2 - basis @ np.linalg.lstsq(basis, v2)[0]) / np.linalg.norm(v2)

    assert misfit(expected) < 1e-4
    assert misfit(expected * [1.0, 1.001]) > 2e-4


def test_motor_crosses_its_gap_in_the_analytic_time():
    own, gap, u0, h = 1.5e-4, 0.4, 0.5, 1e-4
    play = {"motor_gear_backlash.mass": own, "motor_gear_backlash.gap": gap, "motor_gear_backlash.kc": 500.0}
    # a cart too heavy to give way shows the contact force in its acceleration; u pushes, then turns round: 2g without force,
    # begun with the speed that the released contact gives, m·v² = 3·u²/kc at most
    u = u0 * np.where(np.arange(15000) < 14000, 1.0, -1.0)
    felt = np.diff(states({"m1": 1.0, **play}, u, h=h)[1])[14000:]
    alone = np.sum(felt[: np.flatnonzero(felt < 0.0)[0]] == 0.0) * h
    speed = np.sqrt(3 / 500.0 / own) * u0
    slowest = np.sqrt(4 * gap * own / u0)
    quickest = (np.sqrt(speed**2 + 4 * gap * u0 / own) - speed) * own / u0
    assert quickest - 2 * h <= alone <= slowest + 2 * h
    # a cart without friction feels nothing until the motor arrives: from mid gap that takes sqrt(2·g·m/u)
    free = {"m1": 1e-3, **play}
    v1 = states(free, np.full(400, u0), h=h)[1]
    arrives = np.sqrt(2 * gap * own / u0)
    first = np.flatnonzero(v1 > 0.0)[0] * h
    assert first == pytest.approx(arrives, abs=1.5 * h)
    # in the long run motor and cart are one mass
    v = states(free, np.full(2001, u0))[1]
    assert v[-1] == pytest.approx(u0 * 2.0 / (1e-3 + own), rel=0.02)


def test_a_small_motor_is_no_motor():
    u = sine(instants(1.0), 2.0, 2.0)
    plain = states(RIG, u)
    gaps = {"motor_gear_backlash.gap": 0.0}
    apart = [np.abs(states({**RIG, **gaps, "motor_gear_backlash.mass": m}, u) - plain).max() for m in (1e-5, 1e-6)]
    assert apart[1] < 0.2 * apart[0] < 2.0


def test_time_limits_of_delays_are_named():
    with pytest.raises(ValueError, match="encoder_delay.encoder_2.tau: at most 61 samples"):
        Drive({**RIG, "encoder_delay.encoder_2.tau": 0.02}).simulate(np.arange(50) * 1e-4, np.zeros(50))


@each(
    "extra",
    [
        # the damper of a heavy appendage alone moves the light cart at 2ζω·(m_a/m1) = 2320 1/s
        {"m1": 2.4e-5, "extra_mode.mass_1": 5.3e-4, "extra_mode.frequency": 9.07, "extra_mode.zeta": 0.915},
        {"m1": 2.4e-5, "extra_mode.mass_1": 5.3e-4, "extra_mode.frequency": 60.0, "extra_mode.zeta": 0.02},
    ],
)
def test_a_light_cart_beside_a_heavy_body_does_not_run_away(extra):
    """The steps a drive asks for follow the lighter mass: at hλ = 1 RK4 decays to 0.375 instead of 1/e, 2 % off."""
    values = {**RIG, **extra}
    u = 8.0 * np.sign(np.sin(2.0 * np.pi * 2.0 * np.arange(1001) * 1e-3))
    found, fine = states(values, u), states(values, u, physics_step=1e-5)
    for v in (1, 3):
        assert np.abs(found[v] - fine[v]).max() < 0.02 * np.abs(fine[v]).max()
