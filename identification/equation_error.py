r"""Start values without any assumption: least squares on the equations of motion.

Adding the two carts' equations removes the spring, and differentiating the second one removes its unknown rest length,

.. math::
    m_1 \dot v_1 + m_2 \dot v_2 + b_1 v_1 + b_2 v_2 + d_1 \operatorname{sgn} v_1 + d_2 \operatorname{sgn} v_2 &= u, \\
    m_2 \ddot v_2 + b_2 \dot v_2 + d_2 \tfrac{d}{dt} \operatorname{sgn} v_2 - k (v_1 - v_2) &= 0,

so all seven parameters enter linearly, and springs to the frame, where they are known to be there, as well. Every term passes
the same zero-phase low-pass, which keeps the equations and removes the encoder's noise. The estimate is biased by what noise
remains (errors in variables); it starts the output-error fit, no more. Method: L. Ljung, System Identification, 1999, sec. 7.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls
from scipy.signal import butter, sosfiltfilt

from flexdrive_gym.recording import FloatArray, Recording
from identification.signals import velocities
from identification.topology import Topology, topology_of

# the resonance of such drives lies at a few hertz; four times that keeps it and drops the encoder's noise
CUTOFF_HZ = 15.0
# springs to the frame, which are as linear in the equations as the rest, where a rig description knows of them
GROUND = ("ground_spring.kg", "ground_spring.kg_2")


def start_values(recordings: Sequence[Recording], topology: Topology | None = None) -> dict[str, float]:
    """Estimate m1, b1, d1 and, with two carts, m2, b2, d2, k.

    Parameters
    ----------
    recordings
        Open-loop recordings of one drive.
    topology
        Which bodies there are; default: as the recordings' channels tell. Where a body that moves has no sensor the equations
        of motion cannot be written down, and the topology's own start values are all that is known.

    Returns
    -------
    dict
        Parameter name to value in the handout's units; non-negative.
    """
    topology = topology or topology_of(recordings)
    if any("." not in name for name in topology.start):
        return {}
    springs = [n for n in GROUND if n in topology.free][: topology.carts]
    rows = [_regressors(r, topology.carts, len(springs)) for r in recordings]
    matrix, target = np.vstack([a for a, _ in rows]), np.concatenate([b for _, b in rows])
    parts = ["m1", "b1", "d1", "m2", "b2", "d2"][: 3 * topology.carts]
    names = [*parts, *springs, *(["k"] if topology.carts == 2 else [])]
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    solution = nnls(matrix / scale, target)[0] / scale
    return {name: float(value) for name, value in zip(names, solution, strict=True)}


def _regressors(recording: Recording, carts: int, springs: int = 0) -> tuple[FloatArray, FloatArray]:
    h = recording.sample_time
    sos = butter(2, min(CUTOFF_HZ, 0.2 / h), fs=1.0 / h, output="sos")

    def smooth(x: FloatArray) -> FloatArray:
        return np.asarray(sosfiltfilt(sos, x))

    v = velocities(recording)[:carts]
    moving = 1.5 * max(max(recording.quantum) / h, 1e-9)
    low = [smooth(x) for x in v]
    sign = [smooth(np.where(np.abs(x) > moving, np.sign(x), 0.0)) for x in low]
    rate = [np.gradient(x, h) for x in low]
    columns = [c for i in range(len(v)) for c in (rate[i], low[i], sign[i])]
    columns += [smooth(x) for x in _places(recording, v)[:springs]]
    keep = np.ones(recording.n, dtype=np.bool_)
    for i in range(len(v)):
        keep &= recording.valid("v1" if i == 0 else "v2")
    step = max(1, int(0.004 / h))
    momentum = np.column_stack(columns)[keep][::step]
    target = smooth(recording.u)[keep][::step]
    if len(v) == 1:
        return momentum, target
    zero = np.zeros(recording.n)
    # the second equation has the unit V/s; dividing by a typical bandwidth gives both equations like weight
    bandwidth = 2.0 * np.pi * 3.0
    held = [zero, low[1]][:springs]
    second = np.column_stack(
        [zero, zero, zero, np.gradient(rate[1], h), rate[1], np.gradient(sign[1], h), *held, -(low[0] - low[1])]
    )
    second = second[keep][::step] / bandwidth
    first = np.column_stack([momentum, np.zeros(len(momentum))])
    return np.vstack([first, second]), np.concatenate([target, np.zeros(len(second))])


def _places(recording: Recording, v: Sequence[FloatArray]) -> list[FloatArray]:
    """Return where the carts are from their start on [mm]."""
    known = (recording.x1, recording.x2)
    return [
        np.cumsum(speed) * recording.sample_time if x is None else x - x[0] for x, speed in zip(known, v, strict=False)
    ]
