"""The equation error finds what no simulation around the base model can, and starts for all parameters."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from flexdrive_gym import Drive, Recording
from identification.mismatch.candidates.catalogue import catalogue
from identification.mismatch.candidates.screen import Screen
from identification.mismatch.force.smooth import motion
from identification.mismatch.settings import Settings
from identification.topology import TWO_CARTS
from tests.drive.drives import RIG
from tests.identification.mismatch.lab import T, data_set


def test_weak_derivatives_of_a_sine_are_those_of_calculus():
    t = np.arange(3000) * 1e-3
    w = 2.0 * np.pi * 1.5
    x = 10.0 * np.sin(w * t)
    m = motion(Recording("sine", t, np.zeros_like(t), x1=x, x2=x), Settings(), 0.06)
    # the test function averages over its length, which weakens a sine by under one per cent here
    at = t[m.windows.astype(int)] + 0.0295
    assert np.max(np.abs(m.velocity[0] - 10.0 * w * np.cos(w * at))) < 0.01 * 10.0 * w
    assert np.max(np.abs(m.acceleration[0] + 10.0 * w**2 * np.sin(w * at))) < 0.01 * 10.0 * w**2


@pytest.fixture(scope="module")
def grounded():
    """A drive held by a strong spring: without it, simulations run away from what was measured."""
    return data_set({"ground_spring.kg": 0.05}, force=0.02)


def test_a_strong_ground_spring_is_the_first_proposal(grounded):
    with ThreadPoolExecutor(1) as pool:
        proposals = Screen(grounded, Settings(), pool).propose(
            [c for c in catalogue(TWO_CARTS) if c.id in {"ground_spring", "stribeck", "hardening_spring", "dead_zone"}]
        )
    best = proposals[0]
    assert best.candidate.id == "ground_spring"
    assert best.start["ground_spring.kg"] == pytest.approx(0.05, rel=0.1)
    for name in ("m1", "m2", "k"):
        assert best.start[name] == pytest.approx(RIG[name], rel=0.15)


def test_an_unknown_deflection_at_the_start_changes_nothing():
    runs = data_set(force=0.0)
    drive = Drive(RIG)
    shifted = []
    for i, r in enumerate(runs):
        made = drive.simulate(T, r.u, name=r.name)
        shifted.append(replace(made, x2=made.x2 + 3.0 * (-1) ** i, v1=None, v2=None, excitation=r.excitation))
    with ThreadPoolExecutor(1) as pool:
        values = Screen(shifted, Settings(), pool).values
    for name in ("m1", "m2", "k"):
        assert values[name] == pytest.approx(RIG[name], rel=0.1)
