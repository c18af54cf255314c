"""One linear controller on many drives, in the compiled loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flexdrive_gym.drive import parameters
from flexdrive_gym.drive.drive import Drive
from flexdrive_gym.drive.linear_controller import LinearController
from flexdrive_gym.drive.loop import Rigs, Trials, run_linear
from flexdrive_gym.recording import FloatArray


def run_batch(
    drives: Sequence[Drive],
    xr: npt.ArrayLike,
    controller: LinearController,
    *,
    gains: npt.ArrayLike = 1.0,
    late: npt.ArrayLike = 0,
    disturbance: npt.ArrayLike = 0.0,
    start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
    true_states: bool = True,
    sample_time: float | None = None,
    physics_step: float = 1e-3,
) -> FloatArray:
    """Run one controller on many drives in the compiled loop.

    Parameters
    ----------
    drives
        One per job.
    xr : array_like, shape (n,)
        Reference at the rig's samples [mm], before the controller's shaper.
    controller
        A linear controller.
    gains, late : array_like, shape (jobs,) or scalar
        Factor on the command, and whole samples of the rig by which it is held back, for trials of margins.
    disturbance : array_like, shape (n,) or scalar
        Added to the command [V].
    start : array_like, shape (4,)
        x1 [mm], v1 [mm/s], x2 [mm], v2 [mm/s].
    true_states
        Whether the carts' true states are returned, or what the encoders report.
    sample_time
        Of the rig [s]; ``None``: the controller's own. A slower controller's command is held between its samples.
    physics_step
        Longest step of the integration [s].

    Returns
    -------
    ndarray, shape (jobs, 5, n)
        x1, v1, x2, v2 (true states) or x1, x2, v1, v2 (readings), and u.

    Raises
    ------
    ValueError
        If the controller's sample time is no whole multiple of the rig's.
    """
    rig_time = controller.sample_time if sample_time is None else sample_time
    every = controller.every(rig_time)
    if every is None:
        raise ValueError(
            f"sample_time: the controller's {controller.sample_time:g} s must be a whole number of the rig's samples; got "
            f"{rig_time:g} s. Design the controller for a multiple of it."
        )
    shaped, law = controller.shape_held(xr, every), controller.law(every)
    jobs, n = len(drives), len(shaped)
    factor = np.broadcast_to(np.asarray(gains, dtype=np.float64), (jobs,))
    held = np.broadcast_to(np.asarray(late, dtype=np.int64), (jobs,))
    pushed = np.ascontiguousarray(np.broadcast_to(np.asarray(disturbance, dtype=np.float64), (n,)))
    begin, out = np.array(start, dtype=np.float64), np.empty((jobs, 5, n))
    plans: dict[tuple[int, bool], list[int]] = {}
    for j, drive in enumerate(drives):
        steps = parameters.substeps(drive.values, rig_time, physics_step)
        plans.setdefault((steps, parameters.workspace(drive.values) is None), []).append(j)
    for (steps, _base), chosen in plans.items():
        p, z = np.array([drives[j].vector() for j in chosen]), parameters.workspace(drives[chosen[0]].values)
        trials = Trials(factor[chosen], held[chosen], pushed)
        out[chosen] = run_linear(shaped, law, trials, Rigs(p, z, begin, rig_time, steps), true_states=true_states)
    return out
