r"""Where between two instants a velocity changes sign: the root of its cubic Hermite polynomial.

With the values :math:`v_0, v_1` and slopes :math:`\dot v_0, \dot v_1` at both ends of a unit interval,

.. math:: v(\theta) = v_0 + \dot v_0 \theta + c_2 \theta^2 + c_3 \theta^3, \qquad
   c_2 = 3 (v_1 - v_0) - 2 \dot v_0 - \dot v_1, \quad c_3 = 2 (v_0 - v_1) + \dot v_0 + \dot v_1 .

It is the only part of the step (:mod:`flexdrive_gym.drive.step`) that knows nothing of the drive.
"""

from __future__ import annotations

from flexdrive_gym.drive.compilation import called


@called
def crossing(v0: float, slope0: float, v1: float, slope1: float) -> float:
    """Return where in (0, 1) a cubic with these end values and slopes changes sign, v0 (or its slope) against v1.

    Newton's method, kept inside the bracket by bisection.
    """
    c2 = 3.0 * (v1 - v0) - 2.0 * slope0 - slope1
    c3 = 2.0 * (v0 - v1) + slope0 + slope1
    low, high = 0.0, 1.0
    theta = v0 / (v0 - v1)
    if v0 == 0.0:
        if slope0 * v1 >= 0.0:
            return 0.0
        theta = 0.5
    for _ in range(30):
        value = v0 + theta * (slope0 + theta * (c2 + theta * c3))
        if value * v1 > 0.0:
            high = theta
        else:
            low = theta
        slope = slope0 + theta * (2.0 * c2 + 3.0 * theta * c3)
        new = theta - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - theta) < 1e-13:
            return new
        theta = new
    return theta
