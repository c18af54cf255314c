"""One size of an effect in all experiments: chi-squared of what each asks for, by more than noise and inexact laws make."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.fitting.fit import Coordinates
from identification.mismatch.fitting.score import Normal
from identification.mismatch.selection.one_size import differs
from identification.mismatch.settings import Settings

KEY, SIZE, LEVEL = "tilt.F", 0.2, 0.01
TILT = Candidate("tilt", "guide", ((KEY, SIZE),))


def fitted(asked, precision):
    """An optimum at which experiments ask for these sizes, each with a standard error of the size over ``precision``."""
    coordinates = Coordinates(["m1", KEY], {"m1": 1e-3, KEY: SIZE})
    U, z = len(asked), coordinates.of({"m1": 1e-3, KEY: SIZE})
    information = np.zeros((U, 2, 2))
    information[:, 0, 0] = 1.0
    information[:, 1, 1] = (precision / z[1]) ** 2
    gradient = np.zeros((U, 2))
    gradient[:, 1] = -information[:, 1, 1] * (np.asarray(asked) / SIZE - 1.0) * z[1]
    return SimpleNamespace(
        names=("m1", KEY),
        values={"m1": 1e-3, KEY: SIZE},
        interior=np.array([True, True]),
        coordinates=coordinates,
        normal=Normal(information, gradient, np.ones(U)),
        bench=SimpleNamespace(settings=Settings()),
    )


def test_noise_alone_differs_no_more_often_than_the_level():
    rng = np.random.default_rng(1)
    noisy = [differs(fitted(SIZE * (1.0 + rng.standard_normal(12) / 5.0), 5.0), TILT, 0.1) for _ in range(500)]
    assert np.mean(noisy) <= 0.1


def test_two_sizes_differ():
    assert differs(fitted(np.repeat([0.7 * SIZE, 1.3 * SIZE], 6), 20.0), TILT, LEVEL)


@pytest.mark.parametrize("odd", [0, 5])
def test_what_one_experiment_alone_asks_for_is_no_property_of_a_rig(odd):
    asked = np.full(8, SIZE)
    asked[odd] = 3.0 * SIZE
    assert not differs(fitted(asked, 50.0), TILT, LEVEL)


def test_no_law_is_exact_and_no_friction():
    """Nor is friction the same in all runs: sizes that differ by 8 %, plainly seen, are one."""
    asked = np.repeat([0.92 * SIZE, 1.08 * SIZE], 6)
    assert not differs(fitted(asked, 1000.0), TILT, LEVEL)
    assert differs(fitted(np.repeat([0.85 * SIZE, 1.15 * SIZE], 6), 1000.0), TILT, LEVEL)


def test_a_part_that_is_nearly_nothing_may_differ_by_more_than_itself():
    """The sine of a wave whose phase makes it nearly all cosine: a tenth of both together, not of each."""
    wave = Candidate("position_friction", "cart_1", (("sin", SIZE), ("cos", SIZE)))

    def model(small):
        one = fitted(np.full(12, SIZE), 100.0)
        U, h = 12, np.diag([1.0, 1e4, 1e4])
        names = ("m1", "sin", "cos")
        coordinates = SimpleNamespace(log=np.array([True, False, False]), of=lambda _: np.array([0.0, 1.0, 0.01]))
        gradient = np.zeros((U, 3))
        gradient[:, 2] = 1e4 * np.repeat([small, -small], 6)
        return SimpleNamespace(
            names=names,
            values={},
            interior=np.ones(3, dtype=bool),
            coordinates=coordinates,
            normal=Normal(np.tile(h, (U, 1, 1)), gradient, np.ones(U)),
            bench=one.bench,
        )

    assert not differs(model(0.08), wave, LEVEL)
    assert differs(model(0.15), wave, LEVEL)


def test_three_experiments_tell_nothing():
    assert not differs(fitted([0.1 * SIZE, SIZE, 3.0 * SIZE], 100.0), TILT, LEVEL)


def test_a_size_at_its_bound_says_nothing():
    model = fitted(np.repeat([0.7 * SIZE, 1.3 * SIZE], 6), 20.0)
    model.interior = np.array([True, False])
    model.normal = Normal(model.normal.information[:, :1, :1], model.normal.gradient[:, :1], model.normal.square)
    assert not differs(model, TILT, LEVEL)
