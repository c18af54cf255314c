"""Replay: what the base model and the diagnosed drive do where a recording was made, and the force that both leave missing.

The missing force of the diagnosed drive cannot be smoothed out of a recording directly, because the smoother knows the linear
drive and Coulomb friction alone. So the diagnosed drive's own simulation of the recording passes the same smoother: the force
that it finds there is the one the named physics supplies, and what it finds in the recording beyond that remains. Whatever the
smoother gets wrong is in both and cancels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.recording import Recording
from identification.mismatch.answer.verdict import Diagnosis
from identification.mismatch.fitting.bench import free
from identification.mismatch.force.maps import Map, draw_maps
from identification.mismatch.force.missing_force import MissingForce, missing_force
from identification.replay.output_error import prepare, simulate_run
from identification.validation import simulate_like


def replay(drive: Drive, recording: Recording) -> Recording:
    """Return what a drive does where a recording was made: a replay of u in open loop, in the loop for P-control."""
    if recording.closed_loop:
        return simulate_like(drive, recording)
    v = simulate_run(drive.values, free(prepare(recording)))
    return replace(recording, x1=None, x2=None, v1=v[0], v2=v[1] if len(v) > 1 else None, source="simulated")


@dataclass(frozen=True, eq=False)
class Remaining:
    """Missing forces of the estimation recordings, and what the named physics makes of them.

    Attributes
    ----------
    measured
        What the base model leaves missing.
    supplied
        The same in the diagnosed drive's replays: the force that the named physics supplies.
    left
        What remains missing, over the measured motion.
    before, supply, after
        Maps of the three, alike in order: one per cart and variable, most telling first.
    """

    measured: tuple[MissingForce, ...]
    supplied: tuple[MissingForce, ...]
    left: tuple[MissingForce, ...]
    before: tuple[Map, ...]
    supply: tuple[Map, ...]
    after: tuple[Map, ...]

    def most_telling(self) -> int:
        """Return the index of the map whose course the named physics reproduces best; the first where it names nothing."""
        agree = [_agreement(b, s) for b, s in zip(self.before, self.supply, strict=True)]
        return int(np.argmax(agree)) if max(agree, default=0.0) > 0.0 else 0


def _agreement(before: Map, supply: Map) -> float:
    """How much of the variance that follows the variable the supplied force takes away [V²]."""
    known = np.isfinite(supply.centre)
    supplied = np.interp(before.centre, supply.centre[known], supply.mean[known])
    taken = 1.0 - float(np.nansum((before.mean - supplied) ** 2) / np.sum(before.mean[np.isfinite(supplied)] ** 2))
    return max(before.explained, 0.0) * before.size**2 * taken


def remaining(diagnosis: Diagnosis, pool: Executor) -> Remaining:
    """Return what the diagnosis explains of the missing forces, and what it leaves, in the rig's units."""
    base: Mapping[str, float] = diagnosis.base.values
    runs, units = diagnosis.split.estimation, diagnosis.base.units
    measured = diagnosis.forces or tuple(pool.map(lambda r: missing_force(base, r), runs))
    supplied = tuple(pool.map(lambda r: missing_force(base, replay(diagnosis.drive, r)), runs))
    left = tuple(replace(m, g=m.g - s.g) for m, s in zip(measured, supplied, strict=True))
    before = draw_maps(measured)
    order = [(m.where, m.variable) for m in before]
    supply, after = ({(m.where, m.variable): m for m in draw_maps(forces)} for forces in (supplied, left))
    both = [i for i, name in enumerate(order) if name in supply and name in after]

    def told(forces: Sequence[MissingForce]) -> tuple[MissingForce, ...]:
        return tuple(f.of_rig(units) for f in forces)

    def drawn(maps: Sequence[Map]) -> tuple[Map, ...]:
        return tuple(m.of_rig(units) for m in maps)

    return Remaining(
        told(measured),
        told(supplied),
        told(left),
        drawn([before[i] for i in both]),
        drawn([supply[order[i]] for i in both]),
        drawn([after[order[i]] for i in both]),
    )
