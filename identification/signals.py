"""Signals that several methods need, made one way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexdrive_gym.recording import BoolArray, Channel, FloatArray, Recording


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
        noted = f" (noted while reading: {'; '.join(recording.notes)})" if recording.notes else ""
        raise ValueError(
            f"{recording.name}: needs v1 or x1; got neither{noted}. Record cart 1's encoder, or give its column a name and a "
            "unit that are known (docs/recordings.md)."
        )
    return result


def motions(recording: Recording) -> tuple[list[FloatArray], list[BoolArray]]:
    """Return the carts' velocities [mm/s] and which of their samples can be used, whichever carts have a sensor.

    Returns
    -------
    tuple of list of ndarray, each of shape (n,)
        One per cart. A first cart without a sensor has zeros, none of them valid; a second one is absent.

    Raises
    ------
    ValueError
        If no cart has velocity or position.
    """
    names: tuple[Channel | None, Channel | None] = (_sensor(recording, "v1", "x1"), _sensor(recording, "v2", "x2"))
    if names[0] is None and names[1] is not None:
        second = replace(recording, v1=recording.v2, x1=recording.x2, v2=None, x2=None)
        zeros = np.zeros(recording.n)
        return [zeros, *velocities(second)], [zeros.astype(np.bool_), recording.valid(names[1])]
    return velocities(recording), [recording.valid(name) for name in names if name is not None]


def _sensor(recording: Recording, v: Channel, x: Channel) -> Channel | None:
    """Return the channel that tells a cart's motion."""
    return next((name for name in (v, x) if getattr(recording, name) is not None), None)
