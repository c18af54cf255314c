"""Signals that several methods need, made one way."""

from __future__ import annotations

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording


def velocities(recording: Recording) -> list[FloatArray]:
    """Return the carts' velocities [mm/s]: as recorded, else the raw backward difference of the positions.

    Returns
    -------
    list of ndarray, each of shape (n,)
        One per cart.

    Raises
    ------
    ValueError
        If cart 1 has neither velocity nor position.
    """
    result = []
    for v, x in ((recording.v1, recording.x1), (recording.v2, recording.x2)):
        if v is not None:
            result.append(v)
        elif x is not None:
            result.append(np.diff(x, prepend=x[:1]) / recording.sample_time)
        else:
            break
    if not result:
        raise ValueError(f"{recording.name}: needs v1 or x1; got neither. Record cart 1's encoder.")
    return result
