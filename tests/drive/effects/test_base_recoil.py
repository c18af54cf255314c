"""A track that is pushed back: three masses, in the room's coordinates, against what the encoders on the track report."""

import numpy as np
import pytest

from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.sample import WORK_SPACE
from tests.drive.drives import FRICTIONLESS, RIG
from tests.drive.effects.reference import Masses
from tests.drive.effects.runs import instants, states
from tests.each import each

# what quick fits of the handout's rig say
M, FREQUENCY, ZETA = 2.3e-3, 34.0, 0.05
WB = 2 * np.pi * FREQUENCY
KB, CB = M * WB**2, 2 * ZETA * M * WB
TRACK = {"base_recoil.compliance": 1 / KB, "base_recoil.frequency": FREQUENCY, "base_recoil.zeta": ZETA}


class OnTrack(Masses):
    """Absolute accelerations of carts and track, and the friction that sticking needs, from one system of equations."""

    def __init__(self, rig):
        super().__init__(rig, rates=lambda _t, y, _u: [y[5], self.track], extra_start=(0.0, 0.0))
        self.track = 0.0

    def solve(self, t, y, u, s):
        fs = self.spring(y[0] - y[2], y[1] - y[3], y[4:])
        on = [
            drive - self.b[c] * y[1 + 2 * c] - s[c] * self.level[c](t, y, s[c], fs) for c, drive in enumerate((u, 0.0))
        ]
        # unknown: A1, A2, Ab, friction of sticking carts
        a, b = np.zeros((5, 5)), np.array([on[0] - fs, on[1] + fs, -KB * y[4] - CB * y[5] - sum(on), 0.0, 0.0])
        a[0, 0], a[1, 1], a[2, 2] = *self.m, M
        a[0, 3], a[1, 4], a[2, 3], a[2, 4] = -1.0, -1.0, 1.0, 1.0
        for c in (0, 1):
            if s[c]:
                a[3 + c, 3 + c] = 1.0
            else:
                a[3 + c, c], a[3 + c, 2] = 1.0, -1.0
        return np.linalg.solve(a, b), fs

    def forces(self, t, y, u, s):
        found, fs = self.solve(t, y, u, s)
        self.track = found[2]
        relative = [self.m[c] * (found[c] - found[2]) + s[c] * self.level[c](t, y, s[c], fs) for c in (0, 1)]
        return relative, fs

    def over(self, cart, t, y, u):
        s = [np.sign(y[1]), np.sign(y[3])]
        s[cart] = 0.0
        found, fs = self.solve(t, y, u, s)
        needed = -found[3 + cart]
        sign = 1.0 if needed > 0.0 else -1.0
        return needed * sign - self.level[cart](t, y, sign, fs), sign


def with_track(values, u, h=1e-3, start=(0.0, 0.0, 0.0, 0.0), physics_step=1e-3):
    """True x1, v1, x2, v2 and the track's own position and velocity."""
    p, z, memory = parameters.vector(values), parameters.workspace(values), np.zeros(WORK_SPACE)
    substeps = parameters.substeps(values, h, physics_step)
    state, reading = np.array(start, dtype=float), np.zeros(4)
    at = LAYOUT["base_recoil.compliance"].state_index
    kernels.begin(state, h, substeps, memory, z, p, reading)
    out = np.zeros((6, len(u)))
    for i, command in enumerate(u):
        out[:, i] = *state, z[at], z[at + 1]
        kernels.run_sample(state, command, i * h, h, substeps, memory, z, p, reading)
    return out


@each("strong", [True, False])
def test_agrees_with_event_driven_integration_of_three_masses(strong):
    t = instants(0.8)
    # strong: never at rest for long; weak: cart 2 sticks and tears loose, which the track's own acceleration decides too
    u = 1.6 * np.where(t % 0.3 < 0.15, 1.0, -1.0) if strong else 0.75 * np.sin(2 * np.pi * 1.3 * (t // 0.004) * 0.004)
    expected = np.zeros((4, len(t)))
    expected[:, ::4] = OnTrack(RIG).run(t[::4], u[::4])
    u = np.repeat(u[::4], 4)[: len(t)]
    found, plain = states({**RIG, **TRACK}, u), states(RIG, u)
    if not strong:
        assert 0.1 < np.mean(found[3] == 0.0) < 0.9
    error = np.abs(found - expected)[[1, 3], ::4].max()
    assert error <= 2e-5 * np.abs(expected[[1, 3], ::4]).max()
    assert np.abs(found - plain)[[1, 3]].max() > 100.0 * error


@each("frequency", [2.0, 12.0, 20.0, 31.0, 45.0])
def test_frequency_response_is_that_of_three_masses(frequency):
    rig = {**FRICTIONLESS, "b1": 0.02, "b2": 0.01}
    w = 2 * np.pi * frequency
    # A sine of commands is held between samples, so many samples a period
    h = 1.0 / (frequency * 400)
    t = np.arange(400 * round(1.5 * frequency + 8)) * h
    found = states({**rig, **TRACK}, np.sin(w * t), h=h)[[1, 3]]
    last = slice(-400 * 4, None)
    basis = np.exp(-1j * w * t[last]) * 2.0 / len(t[last])
    # the mean of a free run drifts, and is no part of the fundamental
    measured = np.array([np.sum(v[last] * basis) for v in found]) * 1j
    s = 1j * w
    b1, b2, k = rig["b1"], rig["b2"], rig["k"]
    mass, damping = np.diag([rig["m1"], rig["m2"], M]), np.array([[b1, 0, -b1], [0, b2, -b2], [-b1, -b2, b1 + b2 + CB]])
    stiffness = np.array([[k, -k, 0], [-k, k, 0], [0, 0, KB]])
    x = np.linalg.solve(mass * s**2 + damping * s + stiffness, [1.0, 0.0, -1.0])
    held = np.sinc(w * h / 2 / np.pi) * np.exp(-1j * w * h / 2)
    expected = s * (x[:2] - x[2]) * held
    assert np.allclose(measured, expected, rtol=0.0, atol=2e-3 * np.abs(expected).max())


def test_momentum_leaves_through_the_tracks_feet_only():
    values = {**RIG, **TRACK}
    h = 2.5e-4
    u = 2.0 * np.where(np.arange(4000) * h % 0.4 < 0.2, 1.0, -1.0)
    _x1, v1, _x2, v2, xb, vb = with_track(values, u, h)
    momentum = RIG["m1"] * (v1 + vb) + RIG["m2"] * (v2 + vb) + M * vb
    through_feet = -KB * xb - CB * vb
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * h * (through_feet[1:] + through_feet[:-1]))])
    assert np.ptp(momentum) > 0.05
    assert np.abs(momentum - impulse).max() < 2e-3 * np.ptp(momentum)


@each("friction", [True, False])
def test_energy_in_the_room_never_grows_and_stays_without_friction(friction):
    base = RIG if friction else {**FRICTIONLESS, "b1": 0.0, "b2": 0.0}
    values = {**base, **TRACK, "base_recoil.zeta": 0.02 if friction else 0.0}
    x1, v1, x2, v2, xb, vb = with_track(values, np.zeros(3000), 5e-4, (12.0, 150.0, 0.0, -80.0))
    kinetic = base["m1"] * (v1 + vb) ** 2 + base["m2"] * (v2 + vb) ** 2 + M * vb**2
    energy = 0.5 * (kinetic + base["k"] * (x1 - x2) ** 2 + KB * xb**2)
    if friction:
        assert np.all(np.diff(energy) <= 1e-9 * energy[0])
        assert v1[-1] == v2[-1] == 0.0
    else:
        # the track moves only by friction and the motor here, and there is neither
        assert np.abs(vb).max() < 1e-9
        assert np.ptp(energy) < 1e-5 * energy[0]


def test_a_motor_that_moves_nothing_pushes_no_track():
    held = with_track({**RIG, **TRACK}, np.full(300, 0.9 * RIG["d1"]))
    assert np.all(held == 0.0)


def test_a_reversal_shows_in_both_encoders_at_once():
    # frictionless carts: after a quarter period of the track, Δu/(M·ω_b) in the reading of cart 2, as the docstring says
    rig = {**FRICTIONLESS, "b1": 0.0, "b2": 0.0, "k": 1e-6}
    h, undamped = 1e-4, {**TRACK, "base_recoil.zeta": 0.0}
    quarter = round(0.25 / FREQUENCY / h)
    v1, v2 = states({**rig, **undamped}, np.full(quarter + 1, 4.0), h=h)[[1, 3], -1]
    jump = 4.0 / (M * WB)
    assert jump == pytest.approx(8.1, abs=0.1)
    assert v2 == pytest.approx(jump, rel=1e-3)
    assert v1 == pytest.approx(4.0 / rig["m1"] * quarter * h + jump, rel=1e-3)


def test_a_stuck_cart_rides_on_the_track_until_friction_gives_way():
    # cart 2 without a spring worth the name: only the track's acceleration can tear it loose
    rig = {**RIG, "k": 1e-9, "b1": 0.0}
    u = np.full(40, 3.0)
    held = with_track({**rig, **TRACK, "d2": 2.0}, u, 2.5e-4)
    assert np.all(held[3] == 0.0)
    largest = np.abs(np.gradient(held[5], 2.5e-4)).max() * rig["m2"]
    loose = with_track({**rig, **TRACK, "d2": 0.8 * largest}, u, 2.5e-4)
    assert np.any(loose[3] != 0.0)


# a track as light as the carts, which decides what their friction can hold
LIGHT = {"base_recoil.compliance": 0.089, "base_recoil.frequency": 65.0, "base_recoil.zeta": 0.244}


def directions_from_rest(rig, track, u, deflection, xb, vb):
    """The one pair of directions, of all nine, whose accelerations and friction agree with the law of Coulomb."""
    w = 2 * np.pi * track["base_recoil.frequency"]
    mass = 1.0 / (track["base_recoil.compliance"] * w**2)
    foot = -mass * (w**2 * xb + 2.0 * track["base_recoil.zeta"] * w * vb)
    fs = rig["k"] * deflection
    m, d, drive = (rig["m1"], rig["m2"]), (rig["d1"], rig["d2"]), (u, 0.0)
    found = []
    for s in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)):
        # unknown: accelerations in the room of cart 1, cart 2 and the track, friction on the carts
        a, b = np.zeros((5, 5)), np.array([drive[0] - fs, fs, foot - sum(drive), 0.0, 0.0])
        a[0, 0], a[1, 1], a[2, 2], a[0, 3], a[1, 4], a[2, 3], a[2, 4] = *m, mass, -1.0, -1.0, 1.0, 1.0
        for c in (0, 1):
            if s[c]:
                a[3 + c, 3 + c], b[3 + c] = 1.0, -s[c] * d[c]
            else:
                a[3 + c, c], a[3 + c, 2] = 1.0, -1.0
        x = np.linalg.solve(a, b)
        if all(s[c] * (x[c] - x[2]) > 0.0 if s[c] else abs(x[3 + c]) <= d[c] for c in (0, 1)):
            found.append(s)
    assert len(found) == 1
    return found[0]


def test_carts_that_rest_together_part_as_friction_of_both_allows():
    values, rng, seen = {**RIG, **LIGHT}, np.random.default_rng(3), set()
    p, at = parameters.vector(values), LAYOUT["base_recoil.compliance"].state_index
    for _ in range(300):
        u, deflection, xb, vb = rng.uniform(-1, 1, 4) * (1.5, 6.0, 0.05, 15.0)
        expected = directions_from_rest(RIG, LIGHT, u, deflection, xb, vb)
        z, memory, reading = parameters.workspace(values), np.zeros(WORK_SPACE), np.zeros(4)
        state, h = np.array([deflection, 0.0, 0.0, 0.0]), 1e-6
        kernels.begin(state, h, 1, memory, z, p, reading)
        z[at], z[at + 1] = xb, vb
        kernels.run_sample(state, u, 0.0, h, 1, memory, z, p, reading)
        assert (np.sign(state[1]), np.sign(state[3])) == expected
        seen.add(expected)
    assert len(seen) >= 7


def test_the_step_does_not_change_a_motion_in_which_both_carts_come_to_rest():
    u = 2.5 * np.sin(2 * np.pi * 5.0 * instants(0.8))
    coarse, fine, finest = (with_track({**RIG, **LIGHT}, u, physics_step=h) for h in (5e-4, 2.5e-4, 3.125e-5))
    error = [np.abs(x - finest)[[1, 3]].max() for x in (coarse, fine)]
    # of fourth order, not of first
    assert error[0] < 1e-4 * np.abs(finest[[1, 3]]).max()
    assert error[1] < error[0] / 8.0
