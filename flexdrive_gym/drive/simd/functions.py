r"""Sine and cosine of numbers and of packs, by the same sums and products.

A library takes one number at a time: called for lane after lane, a wave along the track costs more than all the rest of a
step. Here the angle is reduced by a multiple n of a quarter turn, and what is left, :math:`|r| \le \pi/4`, is summed from
its Taylor series, so far that the rest is below round-off (J.-M. Muller, Elementary Functions, 3rd ed. 2016, ch. 3 and 11).
The quarter turn is a sum of three parts, the first of which have 33 bits, so that their multiples are exact (W. J. Cody,
W. Waite, Software Manual for the Elementary Functions, 1980). Up to angles of :math:`10^5` both are exact to two units in the
last place of 1.
"""

from __future__ import annotations

from math import factorial, pi
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.simd.pack import chosen

_QUARTER = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
_PER_QUARTER = 2.0 / pi
# coefficients of (sin r - r)/r³ and (cos r - 1)/r² in r², the highest first, in two sums of every other one side by side: each
# step of a sum waits for the one before
_SINE = tuple(tuple((-1.0) ** i / factorial(2 * i + 1) for i in (k, k + 1)) for k in (7, 5, 3, 1))
_COSINE = tuple(tuple((-1.0) ** i / factorial(2 * i) for i in (k, k + 1)) for k in (7, 5, 3, 1))


@inlined
def sine_and_cosine(x: Any) -> tuple[Any, Any]:
    """Return both at once, which takes hardly longer than one of them; x in rad."""
    n = np.floor(x * _PER_QUARTER + 0.5)
    r = ((x - n * _QUARTER[0]) - n * _QUARTER[1]) - n * _QUARTER[2]
    q = r * r
    square = q * q
    s_0, s_1, c_0, c_1 = q * 0.0, q * 0.0, q * 0.0, q * 0.0
    for a_0, a_1 in _SINE:
        s_0, s_1 = s_0 * square + a_0, s_1 * square + a_1
    for a_0, a_1 in _COSINE:
        c_0, c_1 = c_0 * square + a_0, c_1 * square + a_1
    s, c = r + r * (q * (s_0 + s_1 * q)), 1.0 + q * (c_0 + c_1 * q)
    quarter = n - 4.0 * np.floor(0.25 * n)
    odd = (quarter == 1.0) | (quarter == 3.0)
    sine, cosine = chosen(odd, c, s), chosen(odd, s, c)
    return (
        chosen(quarter >= 2.0, -sine, sine),
        chosen((quarter == 1.0) | (quarter == 2.0), -cosine, cosine),
    )
