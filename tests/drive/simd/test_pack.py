"""What is said about packs is what is said about numbers, lane by lane."""

import numba
import numpy as np

from flexdrive_gym.drive.compilation import OPTIONS, pointer
from flexdrive_gym.drive.simd.functions import sine_and_cosine
from flexdrive_gym.drive.simd.pack import (
    WIDTH,
    anywhere,
    chosen,
    lane,
    leading,
    packs_at,
    raised,
    spread,
    with_lane,
)
from tests.each import each

# signs of zero, ends of the range and what is no number among them
A = np.array([1.5, -0.0, np.inf, -7.25, np.nan, 0.0, 3.0, -1e-310])
B = np.array([2.0, 0.0, -3.0, 2.5, 1.0, -0.0, np.nan, 1e308])

OF_TWO = {
    "sum": lambda a, b: a + b,
    "difference": lambda a, b: a - b,
    "product": lambda a, b: a * b,
    "quotient": lambda a, b: a / b,
    "smaller": lambda a, b: min(a, b) + 1.0,
    "larger": lambda a, b: -max(a, b),
    "larger than a number": lambda a, b: max(a, 0.0) + min(2, b),
    "size": lambda a, b: abs(a) - abs(-b),
    "less": lambda a, b: chosen(a < b, a, 1.0),
    "not less": lambda a, b: chosen((a >= b) | (b == 0.0), 2.0, b),
    "other": lambda a, b: chosen((a != b) & (a <= 2.0) & (b > -5.0), a, b),
    "not": lambda a, b: chosen(~(a < b), a, b),
    "exponential": lambda a, b: np.exp(a) + np.floor(b),
    "waves": lambda a, b: sine_and_cosine(a)[0] - 2.0 * sine_and_cosine(b)[1],
    "power": lambda a, b: abs(a) ** 0.3 + b,
}


@each("name", OF_TWO)
def test_every_lane_is_as_the_number_alone(name):
    function = numba.njit(**OPTIONS)(OF_TWO[name])

    @numba.njit(**OPTIONS)
    def packed(a, b, out):
        x, y = packs_at(pointer(a)), packs_at(pointer(b))
        z = packs_at(pointer(out))
        for k in range(len(a) // WIDTH):
            z[k] = function(x[k], y[k])

    out = np.empty_like(A)
    packed(A, B, out)
    alone = np.array([function(a, b) for a, b in zip(A, B, strict=True)])
    assert np.array_equal(out, alone, equal_nan=True)
    assert (
        np.array_equal(np.signbit(out), np.signbit(alone)) or np.isnan(out[np.signbit(out) != np.signbit(alone)]).all()
    )


def test_lanes_are_put_together_and_taken_apart():
    @numba.njit(**OPTIONS)
    def found(out):
        z = packs_at(pointer(out))
        x = with_lane(spread(2.0), 1, 7.0)
        z[0] = x
        return lane(x, 1), lane(x, 3), leading(x), anywhere(x > 5.0), anywhere(x > 8.0), raised(z, 0)

    out = np.zeros(WIDTH)
    assert found(out) == (7.0, 2.0, 2.0, True, False, True)
    assert out.tolist() == [2.0, 7.0, *[2.0] * (WIDTH - 2)]


def test_numbers_are_taken_as_they_are():
    assert chosen(True, 3.0, 4.0) == 3.0
    assert anywhere(True)
    assert leading(4.0) == 4.0
    assert raised(np.array([0.0, 1.0]), 1)
    assert not raised(np.array([0.0, 1.0]), 0)
