"""A controller on the blind rig: the same difference equations as the package's compiled loop, to half an encoder count."""

import numpy as np
import pytest

from baselines.blind_study.payoff import law_of
from baselines.controllers import design
from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig_simulator.kernel import COUNT_MM, LIMIT_V
from baselines.rig_simulator.rig import Law, p_law, quiet, run
from flexdrive_gym import Drive
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.references import handout_trajectory
from tests.each import each

VALUES = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 9.5e-3, "b2": 3.2e-3, "k": 0.096, "d1": 0.36, "d2": 0.25}
XR = handout_trajectory(np.arange(4001) * 1e-3)


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


@each("name", ["p_x2", "pd_x1", "pd_shaped", "lab4", "lab4_friction", "lqg_both"])
def test_the_loop_is_the_packages(name):
    drive = with_rig(Drive(VALUES))
    controller = design(name, drive).controller
    theirs = run_batch([drive], XR, controller)[0]
    ours = run(VALUES, quiet(len(XR)), XR, controller=law_of(controller))
    # the rig cuts counts off where the package rounds, which is half a count of 4.7 µm; the rest is the integrator's
    for ours_x, theirs_x in zip(ours.states[[0, 2]], theirs[[0, 2]], strict=True):
        assert rms(ours_x - theirs_x) < 1.5 * COUNT_MM
    assert rms(XR - ours.states[2]) == pytest.approx(rms(XR - theirs[2]), rel=1e-3)


@each("encoder", [1, 2])
def test_p_control_is_a_law_without_state(encoder):
    motion = run(VALUES, quiet(len(XR)), XR, controller=p_law(0.05, encoder))
    expected = np.clip(0.05 * (XR - COUNT_MM * motion.counts[encoder - 1]), -LIMIT_V, LIMIT_V)
    assert np.allclose(motion.u, expected, atol=1e-12)


def test_the_factor_raises_the_loop_gain_and_leaves_the_feedforward():
    feedforward = np.full(len(XR), 0.1)
    motion = run(VALUES, quiet(len(XR)), XR, controller=p_law(0.02), factor=2.0, feedforward=feedforward)
    assert np.allclose(motion.u, 0.04 * (XR - COUNT_MM * motion.counts[1]) + 0.1, atol=1e-12)


def test_an_integrator_is_led_back_while_the_command_is_limited():
    # u = z + (xr - x1), z' = z + 0.02·(xr - x1) + L·excess: with z led back the command leaves its limit sooner
    B, C = np.array([[0.02, -0.02, 0.0]]), np.array([[1.0], [0.0]])
    D = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 0.0]])
    xr = np.full(2000, 50.0)
    left = {}
    for back in (0.0, 1e-2):
        law = Law(np.ones((1, 1)), B, C, D, np.array([back]), limit=3.0)
        u = run(VALUES, quiet(2000), xr, controller=law).u
        assert np.max(np.abs(u)) == 3.0
        left[back] = np.argmax(u < 3.0)
    assert 0 < left[1e-2] < left[0.0]


def test_the_shaper_repeats_the_reference_later():
    law = Law(*(getattr(p_law(0.05), n) for n in "ABCDL"), shaper=((0, 0.25), (3, 0.75)))
    xr = np.arange(6.0)
    assert law.shaped(xr) == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.75, 2.75])


def test_a_black_box_that_is_the_law_does_the_same():
    """Asked sample by sample, in parts of one sample each, the rig goes on where it was."""
    law = p_law(0.09)
    compiled = run(VALUES, quiet(len(XR)), XR, controller=law, factor=0.8, feedforward=0.1 * XR / 50.0)
    asked = run(
        VALUES,
        quiet(len(XR)),
        XR,
        controller=lambda _t, xr, _y1, y2: 0.09 * (xr - y2),
        factor=0.8,
        feedforward=0.1 * XR / 50.0,
    )
    assert np.max(np.abs(compiled.u - asked.u)) < 1e-9
    assert np.max(np.abs(compiled.states[[0, 2]] - asked.states[[0, 2]])) < COUNT_MM
    assert np.array_equal(compiled.counts.shape, asked.counts.shape)
