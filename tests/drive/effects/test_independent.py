"""Every kind of effect against an integration that shares no code with the package."""

import numpy as np

from tests.drive.drives import RIG
from tests.drive.effects.reference import Masses
from tests.drive.effects.runs import instants, states
from tests.each import each

T = instants(1.2)
U = 1.3 * np.where(T % 0.6 < 0.3, 1.0, -1.0) + 0.4 * np.sin(2 * np.pi * 7 * T)
# the command is held over 4 ms, so that the reference needs fewer intervals
U = U[np.arange(len(T)) // 4 * 4]

D1, D2, K = RIG["d1"], RIG["d2"], RIG["k"]


def clip(x, bound):
    return min(max(x, -bound), bound)


def dahl(v, zeta, xs):
    return v - abs(v) * zeta / xs


def bouc_wen(rate, zeta, xs):
    return (rate - 0.5 * abs(rate) * zeta - 0.5 * rate * abs(zeta)) / xs


def contact(rho, rate, gap, kc):
    inside = rho - clip(rho, gap)
    return kc * inside * max(1.0 + 0.01 * np.sign(inside) * rate, 0.0)


def lossy(felt, rate, loss):
    return K * felt * max(1.0 + loss * np.sign(felt) * rate, 0.0)


def hertz(beyond, kb, d0):
    return np.sign(beyond) * kb * abs(beyond) ** 1.5 / np.sqrt(d0)


WA = 2 * np.pi * 12.0
CASES = {
    "stribeck": (
        {"stribeck.cart_1.extra": 0.1, "stribeck.cart_1.vs": 30.0},
        {"level_1": lambda _t, y, _s, _fs: D1 + 0.1 * np.exp(-((y[1] / 30.0) ** 2))},
        1e-6,
    ),
    "saturating friction": (
        {"saturating_friction.cart_1.d": 0.3, "saturating_friction.cart_1.v0": 60.0},
        {"on_1": lambda _t, y, _s: -0.3 * np.tanh(y[1] / 60.0)},
        1e-5,
    ),
    "breakaway": ({"breakaway.cart_2.extra": 0.1}, {"extra_2": 0.1}, 1e-6),
    "asymmetries and drag": (
        {
            "coulomb_asymmetry.cart_1.a": 0.05,
            "viscous_asymmetry.cart_2.a": 4e-4,
            "quadratic_drag.cart_1.c": 5e-6,
        },
        {
            "level_1": lambda _t, _y, s, _fs: D1 + 0.05 * s,
            "on_1": lambda _t, y, _s: -5e-6 * y[1] * abs(y[1]),
            "on_2": lambda _t, y, _s: -4e-4 * abs(y[3]),
        },
        1e-6,
    ),
    "friction of place, load and time": (
        {
            "position_friction.cart_1.a_sin": 0.1,
            "position_friction.cart_1.slope": -1e-3,
            "position_friction.cart_1.P": 50.0,
            "load_friction.cart_2.mu": 0.05,
            "friction_drift.cart_1.rate": 0.2,
        },
        {
            "level_1": lambda t, y, _s, _fs: (D1 + 0.1 * np.sin(2 * np.pi * y[0] / 50.0) - 1e-3 * y[0]) * (1 + 0.2 * t),
            "on_1": lambda t, y, _s: -0.2 * t * RIG["b1"] * y[1],
            "level_2": lambda _t, _y, _s, fs: D2 + 0.05 * abs(fs),
        },
        1e-6,
    ),
    "springs": (
        {"hardening_spring.k3": 4e-5, "asymmetric_spring.k2": 8e-4},
        {"spring": lambda delta, _rate, _w: K * delta + 8e-4 * delta**2 + 4e-5 * delta**3},
        1e-6,
    ),
    "a spring of two stiffnesses": (
        {"asymmetric_spring.k2": 8e-3, "asymmetric_spring.c": 0.3},
        {"spring": lambda delta, _rate, _w: K * delta + 8e-3 * delta**2 / (1.0 + 0.3 * abs(delta))},
        1e-6,
    ),
    "ground": (
        {"ground_spring.kg": 2e-3, "ground_spring.kg3": 1e-8, "ground_spring.kg_2": 1e-3, "tilt.F": 0.03},
        {
            "on_1": lambda _t, y, _s: -2e-3 * y[0] - 1e-8 * y[0] ** 3 + 0.03 * 7.6 / 11.0,
            "on_2": lambda _t, y, _s: -1e-3 * y[2] + 0.03 * 3.4 / 11.0,
        },
        1e-6,
    ),
    "cogging": (
        {"cogging.a_sin": 0.08, "cogging.a_cos": -0.05, "cogging.P": 15.0},
        {"on_1": lambda _t, y, _s: 0.08 * np.sin(2 * np.pi * y[0] / 15.0) - 0.05 * np.cos(2 * np.pi * y[0] / 15.0)},
        1e-5,
    ),
    "play of the coupling": (
        {"coupling_backlash.g": 0.8},
        {"spring": lambda delta, _rate, _w: K * (delta - clip(delta, 0.8))},
        1e-4,
    ),
    "coils that touch": (
        {"coil_bind.kb": 0.2, "coil_bind.d0": 6.0},
        {"spring": lambda delta, _rate, _w: K * delta + 0.2 * (delta - clip(delta, 6.0))},
        1e-4,
    ),
    "contacts that lose energy": (
        {"coupling_backlash.g": 0.8, "coupling_backlash.loss": 2e-3},
        {"spring": lambda delta, rate, _w: lossy(delta - clip(delta, 0.8), rate, 2e-3)},
        1e-4,
    ),
    "coils that touch one after another": (
        {"coil_bind.kb": 0.2, "coil_bind.d0": 6.0, "coil_bind.n": 0.5},
        {"spring": lambda delta, _rate, _w: K * delta + hertz(delta - clip(delta, 6.0), 0.2, 6.0)},
        1e-4,
    ),
    "bristles": (
        {"presliding.cart_1.fd": 0.2, "presliding.cart_1.xs": 0.3},
        {
            "on_1": lambda _t, y, _s: -0.2 * y[4] / 0.3,
            "rates": lambda _t, y, _u: [dahl(y[1], y[4], 0.3)],
            "extra_start": (0.0,),
        },
        1e-4,
    ),
    "hysteresis of the spring": (
        {"spring_hysteresis.level": 0.1, "spring_hysteresis.xs": 2.0},
        {
            "spring": lambda delta, _rate, w: K * delta + 0.1 * w[0],
            "rates": lambda _t, y, _u: [bouc_wen(y[1] - y[3], y[4], 2.0)],
            "extra_start": (0.0,),
        },
        1e-5,
    ),
    "lag": (
        {"amplifier_lag.tau": 4e-3},
        {
            "command": lambda _u, w, _y: w[0],
            "rates": lambda _t, y, u: [(u - y[4]) / 4e-3],
            "extra_start": (0.0,),
        },
        1e-5,
    ),
    "appendages": (
        {
            "extra_mode.mass_1": 8e-5,
            "extra_mode.mass_2": 4e-5,
            "extra_mode.frequency": 12.0,
            "extra_mode.zeta": 0.05,
        },
        {
            "on_1": lambda _t, y, _s: 8e-5 * (WA**2 * y[4] + 0.1 * WA * (y[5] - y[1])),
            "on_2": lambda _t, y, _s: 4e-5 * (WA**2 * y[6] + 0.1 * WA * (y[7] - y[3])),
            "rates": lambda _t, y, _u: [
                y[5] - y[1],
                -(WA**2) * y[4] - 0.1 * WA * (y[5] - y[1]),
                y[7] - y[3],
                -(WA**2) * y[6] - 0.1 * WA * (y[7] - y[3]),
            ],
            "extra_start": (0.0, 0.0, 0.0, 0.0),
        },
        1e-5,
    ),
    "play of the motor": (
        {"motor_gear_backlash.mass": 1.5e-4, "motor_gear_backlash.gap": 0.2, "motor_gear_backlash.kc": 5.0},
        {
            "command": lambda _u, w, y: contact(w[0], w[1] - y[1], 0.2, 5.0),
            "rates": lambda _t, y, u: [
                y[5] - y[1],
                (u - contact(y[4], y[5] - y[1], 0.2, 5.0)) / 1.5e-4,
            ],
            "extra_start": (0.0, 0.0),
        },
        5e-3,
    ),
}


@each("name", CASES)
def test_agrees_with_event_driven_integration_at_one_millisecond(name):
    values, functions, tolerance = CASES[name]
    expected = np.zeros((4, len(T)))
    expected[:, ::4] = Masses(RIG, **functions).run(T[::4], U[::4])
    found = states({**RIG, **values}, U)
    plain = states(RIG, U)
    error = np.abs(found - expected)[[1, 3], ::4].max()
    peak = np.abs(expected[[1, 3], ::4]).max()
    assert error <= tolerance * peak
    assert np.abs(found - plain)[[1, 3]].max() > 100.0 * error  # the effect is there, and far above the error
