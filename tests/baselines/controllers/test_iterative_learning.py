"""The command learnt on a model: it is worth what the model is worth."""

import numpy as np

from baselines.controllers import design
from baselines.controllers.iterative_learning import learn_feedforward
from baselines.loop_analysis.stability_limit import with_rig
from flexdrive_gym import Drive
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.references import handout_trajectory
from tests.each import each

VALUES = {"m1": 7.6e-4, "m2": 3.4e-4, "b1": 9.5e-3, "b2": 3.2e-3, "k": 0.096, "d1": 0.36, "d2": 0.25}
XR = handout_trajectory(np.arange(4001) * 1e-3)


def error(drive, controller, feedforward=0.0):
    return float(np.sqrt(np.mean((XR - run_batch([drive], XR, controller, disturbance=feedforward)[0, 2]) ** 2)))


@each("effect", [{}, {"dead_zone.uz": 0.3}, {"stribeck.cart_2.extra": 0.15}, {"input_delay.tau": 0.005}], ids=str)
def test_a_model_with_the_rigs_physics_leaves_little_error(effect):
    drive = with_rig(Drive(VALUES | effect))
    controller = design("lab4", drive).controller
    assert error(drive, controller, learn_feedforward(drive, controller, XR)) < 0.2 * error(drive, controller)


def test_naming_the_dead_zone_pays():
    rig, model = with_rig(Drive({**VALUES, "dead_zone.uz": 0.3})), with_rig(Drive(VALUES))
    controller = design("lab4", model).controller
    ignorant, knowing = (error(rig, controller, learn_feedforward(d, controller, XR)) for d in (model, rig))
    assert knowing < 0.5 * ignorant


def test_what_is_bound_to_the_track_is_left_out():
    drive = with_rig(Drive(VALUES))
    rippled = drive.replace({"cogging.a_sin": 0.2, "cogging.P": 20.0})
    controller = design("lab4", drive).controller
    assert np.array_equal(learn_feedforward(rippled, controller, XR), learn_feedforward(drive, controller, XR))
