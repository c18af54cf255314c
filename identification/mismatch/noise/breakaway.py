"""Friction of a run that decides whether a cart breaks away: what it changes there is no multiple of any force.

Where a cart just breaks away, or just does not, a tenth more friction moves the instants at which it comes to rest, and a
direction near the usual drive jumps at others. Random effects that are not linear are linearised at their conditional modes
(M. J. Lindstrom, D. M. Bates, Biometrics 46, 1990): the direction of such a recording is the secant to the friction that is
most probable in it. It is taken only where it leaves less than the most probable amount of the force along the motion does; and
far from the data nobody's friction is extreme, so squares count relative to what the usual friction leaves of a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.nuisance import Direction, friction_of

# amounts of friction that are simulated, in its standard deviations between runs
_AMOUNTS = np.array([-5.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 5.0])


def with_secants(bench: Bench, values: Values, found: Sequence[Direction], noise: Noise) -> list[Direction]:
    """Return run-to-run variability with the friction of every recording linearised where it is most probable.

    Parameters
    ----------
    found
        Run-to-run variability around the drive.
    noise
        Of a residual like the drive's; it tells what is probable.
    """
    here = bench.residual(values)
    made = list(found)
    for i, own in enumerate(found):
        level = next((f"d{c + 1}" for c in range(bench.carts) if own.group == friction_of(c)), "")
        if values.get(level, 0.0) > 0.0:
            many = bench.residuals([{**values, level: values[level] * (1.0 + own.size * x)} for x in _AMOUNTS])
            made[i] = replace(own, change=_likeliest(bench, noise, here, np.column_stack(many), own))
    return made


def _likeliest(bench: Bench, noise: Noise, here: FloatArray, moved: FloatArray, own: Direction) -> FloatArray:
    """Return the change of rows per unit amplitude, in each recording by the force or by the likeliest secant, shape (N,)."""
    white = noise.innovations(np.column_stack([here, own.size * own.change, moved]), bench.pool.map)
    change = own.change.copy()
    for rows in bench.rows:
        e, D, others = white[rows, 0], white[rows, 1], white[rows, 2:]
        usual = max(float(e @ e) / max(int(bench.valid[rows].sum()), 1), 1.0)
        by_force = (e @ e - (e @ D) ** 2 / (usual + D @ D)) / usual
        by_secant = np.sum(others**2, axis=0) / usual + _AMOUNTS**2
        best = int(np.argmin(by_secant))
        if by_secant[best] < by_force:
            change[rows] = (moved[rows, best] - here[rows]) / (own.size * _AMOUNTS[best])
    return change
