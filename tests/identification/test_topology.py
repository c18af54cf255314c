"""Other rigs than the lab's: what they lack is said once, and every step of the engine keeps to it."""

import numpy as np
import pytest

from flexdrive_gym import Drive, Recording
from identification import identify_by_likelihood
from identification.initial_state import with_start
from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.split import cut, split_recordings
from identification.replay.output_error import prepare, prepare_measured, residuals, simulate_run
from identification.topology import CART, GROUND_MASS, TWO_CARTS, Topology, grounded, topology_of
from tests.drive.drives import RIG

T = np.arange(4001) * 1e-3
U = 1.5 * np.sign(np.sin(2.0 * np.pi * 0.8 * T)) + 1.0 * np.sin(2.0 * np.pi * 3.1 * T)
OSCILLATOR = grounded("oscillator", {"m1": 1e-3, "b1": 1e-3, "k": 0.3})


def test_channels_tell_one_cart_from_two():
    v = np.zeros(3)
    one, two = Recording("a", T[:3], v, x1=v), Recording("b", T[:3], v, v1=v, x2=v)
    assert topology_of([one]) is CART
    assert topology_of([two]) is TWO_CARTS
    assert topology_of([one, two]) is CART


def test_a_topology_is_checked():
    with pytest.raises(ValueError, match="carts: must be 1 or 2; got 3"):
        Topology("three", 3, ("m1",))
    with pytest.raises(ValueError, match=r"fixed: what is fixed cannot be free; got b1 twice"):
        Topology("both", 1, ("m1", "b1"), {"b1": 0.0})
    with pytest.raises(KeyError, match="m3"):
        Topology("unknown", 1, ("m3",))


def test_what_a_topology_does_not_take_for_granted_is_a_candidate():
    def names(topology):
        return {c.name for c in catalogue(topology)}

    assert ("coulomb_friction", "cart_1") not in names(CART)
    assert ("coulomb_friction", "cart_1") in names(Topology("linear cart", 1, ("m1", "b1")))
    assert not {where for _, where in names(CART)} & {"cart_2", "spring", "encoder_2"}
    assert not {where for _, where in names(OSCILLATOR)} & {"cart_2", "encoder_2"}
    assert ("hardening_spring", "spring") in names(OSCILLATOR)
    # recordings of the lab know how their velocities were made
    assert not {id_ for id_, _ in names(TWO_CARTS)} & {"velocity_processing", "coulomb_friction", "spring"}


def test_a_cart_without_a_sensor_has_no_valid_samples():
    run = Drive(RIG).simulate(T, U)
    seen = prepare(Recording("second only", run.t, run.u, v2=run.v2))
    assert not seen.keep[0].any()
    assert seen.keep[1].all()
    assert np.max(np.abs(residuals(RIG, [seen])[1])) < 1e-9


def test_a_second_cart_seen_alone_tells_the_drive():
    true = {"m1": 7e-4, "m2": 1.2e-3, "b1": 8e-3, "k": 0.3}
    run = Drive(true).simulate(T, U)
    topology = Topology(
        "belt", 2, tuple(true), {"b2": 0.0}, frozenset({"encoder_1"}), {"m1": 1e-3, "m2": 5e-4, "b1": 1e-2, "k": 0.1}
    )
    found = identify_by_likelihood([Recording("belt", run.t, run.u, v2=run.v2)], topology=topology)
    for name, value in true.items():
        assert found.drive[name] == pytest.approx(value, rel=0.02)


def test_a_grounded_spring_oscillates_about_the_ground():
    m, b, k, f = 1e-3, 2e-2, 0.3, 3.0
    u = np.sin(2.0 * np.pi * f * T)
    run = Drive({"m1": m, "m2": GROUND_MASS, "b1": b, "k": k}).simulate(T, u)
    s = 2j * np.pi * f
    steady = np.imag(1.0 / (m * s**2 + b * s + k) * np.exp(s * (T - 0.5e-3)))
    assert np.max(np.abs(run.x1 - steady)[-1000:]) < 1e-3 * np.max(np.abs(steady))
    assert np.max(np.abs(run.x2)) < 1e-6


def test_a_sampled_continuous_command_is_neither_delayed_nor_weakened():
    m, b, k, h, f = 1e-5, 1.4e-4, 0.2, 5e-3, 30.0
    t = np.arange(4000) * h
    u = np.sin(2.0 * np.pi * f * t)
    s = 2j * np.pi * f
    steady = np.imag(1.0 / (m * s**2 + b * s + k) * np.exp(s * t))
    drive = {"m1": m, "m2": GROUND_MASS, "b1": b, "k": k}
    error = {}
    for hold in ("zero", "band_limited"):
        run = prepare_measured(Recording("sine", t, u, x1=steady, hold=hold))
        middle = slice(2000, 3900)
        error[hold] = np.std((simulate_run(drive, run)[0] - steady)[middle]) / np.std(steady)
    assert error["band_limited"] < 5e-3
    # half a sample is 0.47 rad at 30 Hz
    assert error["zero"] > 0.3


def test_the_first_samples_tell_the_start_state():
    drive = {"m1": 1e-3, "m2": GROUND_MASS, "b1": 2e-3, "k": 0.3}
    start = (3.0, -40.0, 0.0, 0.0)
    run = Drive(drive).simulate(T, U, start=start)
    found = with_start(drive, prepare_measured(Recording("moving", run.t, run.u, x1=run.x1)), 30, moving=1)
    assert found.start == pytest.approx(start, abs=5e-2)


def test_parts_of_a_run_start_where_the_run_was():
    run = Drive({"m1": 1e-3, "b1": 5e-3, "d1": 0.2}).simulate(T, U)
    whole = Recording("one", run.t, run.u, x1=run.x1)
    parts = cut(whole)
    assert sum(p.n for p in parts) == whole.n
    assert [p.t[0] for p in parts] == pytest.approx([0.0, 2.0], abs=2e-3)
    last = prepare_measured(parts[-1])
    assert last.start[0] == parts[-1].x1[0]
    error = simulate_run({"m1": 1e-3, "b1": 5e-3, "d1": 0.2}, last)[0] - parts[-1].x1
    assert np.max(np.abs(error)) < 0.5


def test_a_single_long_run_is_cut_and_a_short_one_is_not():
    t = np.arange(20000) * 1e-3
    x = np.sin(t) * 50.0
    split = split_recordings([Recording("long", t, np.cos(t), x1=x)])
    assert split.blocks
    assert sum(r.n for r in (*split.estimation, *split.report)) == 20000
    assert len(split.report) >= 2
    short = split_recordings([Recording("short", t[:2000], np.cos(t[:2000]), x1=x[:2000])])
    assert len(short.estimation) == 1
    assert short.report == ()
