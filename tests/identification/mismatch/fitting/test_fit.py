"""Fits of a drive to short runs whose parameters are known."""

import numpy as np
import pytest

from identification.mismatch.fitting.fit import Coordinates, fit, gain_of, resolved
from identification.mismatch.noise.estimate import first_noise
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import bench_of, data_set

NAMES = ("m1", "m2", "b1", "k", "d1")


@pytest.fixture(scope="module")
def bench():
    with bench_of(data_set(force=0.0)) as made:
        yield made


@pytest.fixture(scope="module")
def found(bench):
    start = {**RIG, "m1": 1.15 * RIG["m1"], "k": 0.9 * RIG["k"], "d1": 0.8 * RIG["d1"]}
    return fit(bench, first_noise(bench, RIG), start, NAMES)


def test_a_motor_of_a_hundredth_of_its_cart_follows_the_command_as_far_as_encoders_tell(bench):
    """It crosses a gap of 2 x 0.2 mm in less than 2 ms; what is lighter is none, and a fit does not go there."""
    key, lighter = "motor_gear_backlash.mass", min(RIG["m1"], RIG["m2"])
    motor = {key: 0.01 * lighter, "motor_gear_backlash.gap": 0.2, "motor_gear_backlash.kc": 20.0}
    change = bench.residual({**RIG, **motor}) - bench.residual(RIG)
    assert np.sqrt(np.mean(change[bench.valid] ** 2)) < np.sqrt(np.mean(bench.floor))
    assert Coordinates([key], RIG).lower == pytest.approx(0.01 * lighter)
    assert Coordinates(["m2"], RIG).lower < 1e-6


@pytest.mark.parametrize(
    ("effect", "at_once"),
    [
        ({"extra_mode.mass_1": 5.0 * RIG["m1"], "extra_mode.frequency": 150.0, "extra_mode.zeta": 0.5}, 6.0),
        (
            {
                "motor_gear_backlash.mass": 0.05 * RIG["m1"],
                "motor_gear_backlash.gap": 1e-3,
                "motor_gear_backlash.kc": 6e5 * RIG["m1"],
            },
            1.05,
        ),
    ],
    ids=["a stiff appendage", "a hard contact"],
)
def test_stiff_parts_that_no_fit_follows_are_rigid_as_far_as_encoders_tell(bench, effect, at_once):
    """An appendage that follows at once is mass of its cart, and so is a motor without a gap."""
    change = bench.residual({**RIG, **effect}) - bench.residual({**RIG, "m1": at_once * RIG["m1"]})
    assert not resolved({**RIG, **effect})
    assert np.sqrt(np.mean(change[bench.valid] ** 2)) < np.sqrt(np.mean(bench.floor))


@pytest.mark.parametrize("start", [1e-6, 2e-4, 5e-3])
def test_a_lag_is_found_from_any_start(start):
    """To within half a sample; a short one needs no finer steps, so there is no rate that it is too fast for."""
    key, lag = "amplifier_lag.tau", 2e-3
    with bench_of(data_set({key: lag}, force=0.0)) as bench:
        found = fit(bench, first_noise(bench, RIG), {**RIG, key: start, "m1": 1.1 * RIG["m1"]}, (*NAMES, key))
    assert found.values[key] == pytest.approx(lag, abs=0.5e-3)
    assert found.values["m1"] == pytest.approx(RIG["m1"], rel=0.02)


def test_a_fit_finds_the_drive(found):
    for name in NAMES:
        assert found.values[name] == pytest.approx(RIG[name], rel=0.02)
    assert found.interior.all()


def test_derivatives_of_a_fit_nearby_lead_to_the_same_optimum(bench, found):
    start = {**found.values, "k": 1.05 * found.values["k"]}
    again = fit(bench, found.metric, start, (*NAMES, "b2"), near=found)
    assert again.cost <= 1.01 * found.cost
    assert again.values["k"] == pytest.approx(found.values["k"], rel=0.01)


def test_derivatives_are_those_at_the_optimum(bench, found):
    step = 1e-3 * found.values["k"]
    moved = bench.residual({**found.values, "k": found.values["k"] + step})
    slope = (moved - found.residual) / step * found.scale[NAMES.index("k")]
    own = found.jacobian[:, NAMES.index("k")]
    assert np.linalg.norm(slope - own) < 0.1 * np.linalg.norm(own)


def test_a_first_try_ends_when_steps_no_longer_help(bench, found):
    again = fit(bench, found.metric, found.values, NAMES, iterations=4, near=found)
    assert again.values["k"] == pytest.approx(found.values["k"], rel=1e-3)
    assert again.cost <= found.cost


def test_every_start_within_a_factor_of_three_ends_in_the_same_optimum(bench, found):
    rng = np.random.default_rng(0)
    far = np.exp(rng.uniform(-np.log(3.0), np.log(3.0), (12, len(NAMES))))
    for factors in far:
        start = {**RIG, **{n: RIG[n] * f for n, f in zip(NAMES, factors, strict=True)}}
        assert fit(bench, found.metric, start, NAMES).cost == pytest.approx(found.cost, rel=1e-3)


class _Without:
    """The metric of all recordings but one."""

    def __init__(self, noise, rows):
        self.noise, self.rows = noise, rows

    def white(self, x):
        y = self.noise.white(x)
        y[self.rows] = 0.0
        return y


def test_a_fit_gains_what_it_predicts_of_recordings_that_are_left_out_of_it():
    """Each is predicted by fits to the others (M. Stone, J. R. Stat. Soc. B 39, 1977); of two more parameters one is real."""
    more = (*NAMES, "quadratic_drag.cart_1.c", "hardening_spring.k3")
    with bench_of(data_set({"quadratic_drag.cart_1.c": 1e-5}, force=0.05)) as bench:
        noise = first_noise(bench, RIG)
        one = fit(bench, noise, RIG, NAMES)
        other = fit(bench, noise, {**one.values, more[-2]: 1e-6, more[-1]: 1e-6}, more)
        predicted = 0.0
        for rows in bench.rows:
            part = _Without(noise, rows)
            left = [noise.white(fit(bench, part, f.values, f.names).residual)[rows] for f in (one, other)]
            predicted += 0.5 * float(left[0] @ left[0] - left[1] @ left[1])
        gain = gain_of(one, other)
        apart = bench.sums(noise.white(one.residual - other.residual)[:, None] ** 2)[:, 0]
    # the likelihood ratio less the parameters is what is predicted; bounds only take off
    assert 0.5 * (one.cost - other.cost) - 2.0 == pytest.approx(predicted, rel=0.1)
    assert 0.5 * predicted < gain.sum() < predicted
    assert (np.abs(gain) <= 0.5 * apart + 1e-9).all()


def test_a_slow_drive_may_be_far_more_viscous_than_the_handouts():
    """A motor that turns by 36 rad in 20 s is simulated at 2 mm/s under volts: a bench in newton metres has 2.4 V s/mm."""
    slow = {"m1": 2.5, "b1": 2.4}
    own = Coordinates(tuple(slow), slow)
    assert own.to(own.of(slow), {}) == pytest.approx(slow)
