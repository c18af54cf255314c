"""Friction of a run that decides whether a cart breaks away: what it changes there is no multiple of any force.

Where a cart just breaks away, or just does not, a tenth more friction moves the instants at which it comes to rest, and a
direction near the usual drive jumps at others. Random effects that are not linear are linearised at their conditional modes
(M. J. Lindstrom, D. M. Bates, Biometrics 46, 1990): the direction of such a recording is the secant to the friction that is
most probable in it. It is taken only where it leaves less than the most probable amount of the force along the motion does,
and by more than the best of so many amounts does by chance. Far from the data nobody's friction is extreme, so squares count
relative to what the usual friction leaves of a row. A cart with bristles has no secants: long ones let go little by little, short
ones do not, and would need them (``docs/decisions/0051``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.bench import Bench, Values
from identification.mismatch.noise.estimate import Noise
from identification.mismatch.noise.friction import dry_level
from identification.mismatch.noise.nuisance import Direction, friction_of

# amounts of friction that are simulated, in its standard deviations between runs
_AMOUNTS = np.array([-5.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 5.0])
# squares that the best of them may leave less by chance, in one recording of twenty
_CHANCE = 2.0 * np.log(len(_AMOUNTS) / 0.05)


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
    for c in range(bench.carts):
        level = f"d{c + 1}"
        at = next((i for i, d in enumerate(found) if d.group == friction_of(c)), None)
        if at is not None and values.get(level) == dry_level(values, c):
            size = found[at].size
            many = bench.residuals([{**values, level: values[level] * (1.0 + size * x)} for x in _AMOUNTS])
            made[at] = replace(found[at], change=_likeliest(bench, noise, here, np.column_stack(many), found[at]))
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
        if by_secant[best] + _CHANCE < by_force:
            change[rows] = (moved[rows, best] - here[rows]) / (own.size * _AMOUNTS[best])
    return change
