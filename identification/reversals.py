"""The mean of all reversals of a command, aligned: replicates fall onto one line there, so what is left is physics.

Friction that differs between runs, places and the encoder's counts average out. What is faster than the spring can carry stands
out: play, delay, and a track that gives way, which shows in both encoders at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording
from identification.signals import motions

BEFORE_S, AFTER_S = 0.02, 0.1
JUMP_S = 0.01
# until then a run starts from rest
_SETTLED_S = 0.5
_REST_S = 5e-3


@dataclass(frozen=True, eq=False)
class Reversal:
    """The mean reversal of one recording, turned so that the command rises.

    Attributes
    ----------
    recording
        Its name.
    t
        Since the reversal [s], shape (n,).
    v
        Velocity per cart less what it was just before [mm/s], shape (carts, n).
    count
        How many reversals.
    """

    recording: str
    t: FloatArray
    v: FloatArray
    count: int

    def jumps(self) -> tuple[float, ...]:
        """Return the largest change of every cart's velocity within 10 ms [mm/s]."""
        early = (self.t >= 0.0) & (self.t <= JUMP_S + 1e-9)
        return tuple(float(v[early][np.argmax(np.abs(v[early]))]) for v in self.v)


def mean_reversal(recording: Recording, velocities: Sequence[FloatArray] | None = None) -> Reversal | None:
    """Return the mean of a recording's reversals.

    Parameters
    ----------
    recording
        Of a square wave; a reversal is a change of sign of the command within a sample.
    velocities
        Others at the same instants, as simulated [mm/s]; default: as measured. Reversals with a fault are left out of both.

    Returns
    -------
    Reversal or None
        ``None`` where the command never reverses at once, or every reversal has a fault.
    """
    measured, keep = motions(recording)
    h, u = recording.sample_time, recording.u
    before, after, rest = round(BEFORE_S / h), round(AFTER_S / h), max(1, round(_REST_S / h))
    amplitude = float(np.max(np.abs(u)))
    turns = np.flatnonzero((u[1:] * u[:-1] < 0.0) & (np.abs(np.diff(u)) > amplitude)) + 1
    found = []
    for i in turns[(turns * h > _SETTLED_S) & (turns - before >= 0) & (turns + after <= recording.n)]:
        part = slice(i - before, i + after)
        if all(k[part].all() for k in keep):
            pieces = np.array([np.sign(u[i]) * v[part] for v in (velocities or measured)])
            found.append(pieces - pieces[:, before - rest : before].mean(axis=1, keepdims=True))
    if not found:
        return None
    t = np.asarray(np.arange(-before, after) * h, dtype=np.float64)
    return Reversal(recording.name, t, np.asarray(np.mean(found, axis=0), dtype=np.float64), len(found))
