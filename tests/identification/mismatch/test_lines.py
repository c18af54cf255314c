"""A rhythm from outside is a line; the drive's own resonance is none."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from flexdrive_gym import Drive
from identification.mismatch.lines import strongest_line

STEP, BLOCKS, RUNS = 5e-3, 1600, 12
# hardly damped: it rings at 3.6 Hz
VALUES = {"m1": 5e-4, "m2": 3e-4, "b1": 1e-3, "b2": 5e-4, "k": 0.1, "d1": 0.3, "d2": 0.1}


def bench():
    runs = [SimpleNamespace(block=5, sample_time=1e-3, keep=(None, None)) for _ in range(RUNS)]

    def piece(run, cart):
        return slice((2 * run + cart) * BLOCKS, (2 * run + cart + 1) * BLOCKS)

    return SimpleNamespace(runs=runs, rows=SimpleNamespace(blocks=(BLOCKS,) * RUNS), piece=piece)


def shaken(rng):
    """Velocities of both carts under a random force on cart 2."""
    drive, force = Drive(VALUES).linear, rng.standard_normal(RUNS * 2 * BLOCKS).reshape(RUNS, 2 * BLOCKS)
    parts = []
    for run in force:
        for x in ("x1", "x2"):
            system = (np.append(drive.numerator(x, "d2"), 0.0), drive.denominator)
            num, den, _ = cont2discrete(system, STEP)
            parts.append(lfilter(num.ravel(), den, run)[BLOCKS:])
    return np.concatenate(parts)


def test_a_resonance_is_no_line():
    residual = shaken(np.random.default_rng(0))
    assert strongest_line(bench(), residual, [0.0] * RUNS, VALUES) is None
    # a drive that does not ring would have to call it one
    heavy = {**VALUES, "b1": 0.1, "b2": 0.1}
    found = strongest_line(bench(), residual, [0.0] * RUNS, heavy)
    assert found is not None
    assert found.frequency == pytest.approx(3.6, abs=0.6)


def test_a_line_is_found_beside_a_resonance():
    rng = np.random.default_rng(1)
    residual = shaken(rng)
    t = np.arange(BLOCKS) * STEP
    phases = rng.uniform(0.0, 2.0 * np.pi, 2 * RUNS)
    line = np.sin(2.0 * np.pi * 7.5 * t + phases[:, None]).ravel()
    found = strongest_line(bench(), residual + 1.5 * np.std(residual) * line, [0.0] * RUNS, VALUES)
    assert found.frequency == pytest.approx(7.5, abs=0.13)
    assert found.share > 0.2
