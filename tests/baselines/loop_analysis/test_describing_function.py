"""The sweep of a linear controller is its frequency response; that of a relay is what the book says."""

import numpy as np
import pytest

from baselines.controllers import design
from baselines.evaluation.adapters import PolicyController
from baselines.loop_analysis.describing_function import analytic_response, predicted_gain_margins, sweep
from baselines.loop_analysis.margins import margins
from flexdrive_gym import DEFAULT_DRIVE
from flexdrive_gym.task import Task
from tests.each import each

SOME = (0.5, 1.0, 2.5, 3.0, 4.0, 8.0, 16.0)


@each("period", [1e-3, 5e-3])
def test_lab_4_answers_as_its_transfer_function_says(period):
    lab4 = design("lab4", DEFAULT_DRIVE, sample_time=period).controller
    # small enough for the leads not to meet the command's limit at 16 Hz
    found = sweep(lab4, "x2", frequencies=SOME, amplitudes=(0.3,)).response[0]
    expected = analytic_response(lab4, "x2", SOME)
    # a command held for n samples of 1 ms and read at each of them: a sum of n delays
    n = round(period / 1e-3)
    late = np.mean([np.exp(-2j * np.pi * np.array(SOME) * 1e-3 * i) for i in range(n)], axis=0)
    assert np.max(np.abs(found / (expected * late) - 1.0)) < 0.01


def test_a_relay_has_four_over_pi_a():
    def relay(observation):
        return 2.0 * np.sign(observation.xr - observation.x2)

    found = sweep(relay, "x2", frequencies=(1.0,), amplitudes=(1.0, 4.0), quantum=0.0).response[:, 0]
    assert found == pytest.approx([4 * 2.0 / np.pi, 4 * 2.0 / (np.pi * 4.0)], rel=0.01)


def test_a_policy_is_swept_at_its_own_period():
    class Proportional:
        def act_many(self, observations):
            return 0.05 * observations[:, [2]] / 8.0

    agent = PolicyController(Proportional(), Task("non_collocated", drive=DEFAULT_DRIVE))
    found = sweep(agent, "x2", frequencies=(2.0, 10.0), amplitudes=(1.0, 5.0)).response
    late = np.mean([np.exp(-2j * np.pi * np.array([2.0, 10.0]) * 1e-3 * i) for i in range(5)], axis=0)
    assert np.max(np.abs(found / (0.05 * late) - 1.0)) < 0.01


@pytest.mark.slow
def test_its_loop_predicts_the_gain_margin():
    drive = DEFAULT_DRIVE
    lab4 = design("lab4", drive).controller
    grid = np.arange(0.25, 20.0, 0.25)
    found = sweep(lab4, "x2", frequencies=grid, amplitudes=(0.5,))
    assert predicted_gain_margins(found, drive)[0] == pytest.approx(margins(drive, lab4).gain_margin, rel=0.03)


def test_frequencies_must_fit():
    with pytest.raises(ValueError, match=r"multiples of 0\.25 Hz.*got 0\.3"):
        sweep(lambda _o: 0.0, "x2", frequencies=(0.3,))
    with pytest.raises(ValueError, match="amplitudes: must be positive"):
        sweep(lambda _o: 0.0, "x2", frequencies=(1.0,), amplitudes=(0.0,))
