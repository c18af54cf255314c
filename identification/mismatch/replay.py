"""Replay: what the free fit and the diagnosed drive do where a recording was made, and the force that both leave missing.

The missing force of the diagnosed drive cannot be smoothed out of a recording directly, because the smoother knows the linear
drive and Coulomb friction alone. So the diagnosed drive's own simulation of the recording passes the same smoother: the force
that it finds there is the one the named physics supplies, and what it finds in the recording beyond that remains. Whatever the
smoother gets wrong is in both and cancels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.recording import Recording
from identification.mismatch.crew import Crew
from identification.mismatch.maps import Map, draw_maps
from identification.mismatch.missing_force import MissingForce, missing_force
from identification.mismatch.prove import place
from identification.mismatch.verdict import Diagnosis
from identification.replay.output_error import prepare, simulate_run
from identification.validation import simulate_like


def replay(drive: Drive, recording: Recording, offset: float = 0.0) -> Recording:
    """Return what a drive does where a recording was made: a replay of u in open loop, in the loop for P-control.

    Parameters
    ----------
    offset
        Where the run began along the track [mm].
    """
    if recording.closed_loop:
        return simulate_like(drive, recording)
    run = prepare(recording)
    run.track[:] += offset
    v = simulate_run(drive.values, run)
    return replace(recording, x1=None, x2=None, v1=v[0], v2=v[1] if len(v) > 1 else None, source="simulated")


def replays(drive: Drive, recordings: Sequence[Recording], pool: Crew) -> list[Recording]:
    """Return the replays of open-loop recordings, each begun where along the track it fits best."""
    offsets = place(drive.values, recordings, pool)
    return list(pool.map(lambda item: replay(drive, *item), zip(recordings, map(float, offsets), strict=True)))


@dataclass(frozen=True, eq=False)
class Remaining:
    """Missing forces of the recordings learnt from, and what the named physics makes of them.

    Attributes
    ----------
    measured
        What the free fit leaves missing.
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


def remaining(diagnosis: Diagnosis, pool: Crew) -> Remaining:
    """Return what the diagnosis explains of the missing forces, and what it leaves."""
    free: Mapping[str, float] = diagnosis.free.values
    runs = diagnosis.split.learn
    measured = diagnosis.forces or tuple(pool.map(lambda r: missing_force(free, r), runs))
    simulated = replays(diagnosis.drive, runs, pool)
    supplied = tuple(pool.map(lambda r: missing_force(free, r), simulated))
    left = tuple(replace(m, g=m.g - s.g) for m, s in zip(measured, supplied, strict=True))
    before = draw_maps(measured)
    order = [(m.where, m.variable) for m in before]
    supply, after = ({(m.where, m.variable): m for m in draw_maps(forces)} for forces in (supplied, left))
    both = [i for i, name in enumerate(order) if name in supply and name in after]
    return Remaining(
        measured,
        supplied,
        left,
        tuple(before[i] for i in both),
        tuple(supply[order[i]] for i in both),
        tuple(after[order[i]] for i in both),
    )
