"""One controller on many drives, on the rig at 1 kHz: the one road that comparisons, margins and sweeps take.

A linear controller runs in the compiled loop. A policy that answers for many observations at once commands all drives
in one batch. Any other black box is called sample by sample, drive by drive. All three return the same: true states and commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from baselines.evaluation.adapters import PolicyBatch, PolicyController
from flexdrive_gym import Controller, Drive, LinearController, Observation
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.drive.batch.lockstep import Lockstep
from flexdrive_gym.drive.controller import command_of
from flexdrive_gym.recording import FloatArray

RIG_TIME_S = 1e-3


@dataclass(frozen=True, eq=False)
class Previewed:
    """A linear controller with a fixed preview of the reference, as a policy has one.

    Parameters
    ----------
    controller
        Its loop and its margins do not change with the preview.
    lead
        [s], whole samples of the rig.
    """

    controller: LinearController
    lead: float

    def previewed(self, xr: FloatArray, sample_time: float) -> FloatArray:
        """Return the reference as the controller hears it, ndarray, shape (n,) [mm].

        It starts from where the reference starts, the lead growing with time, lest a design that differentiates it gets a jump;
        at its end it rests.
        """
        at = np.arange(len(xr))
        return np.asarray(xr[np.minimum(at + np.minimum(at, round(self.lead / sample_time)), len(xr) - 1)])


def run_many(
    controller: Controller | Previewed,
    drives: Sequence[Drive],
    xr: npt.ArrayLike,
    *,
    gains: npt.ArrayLike = 1.0,
    late: npt.ArrayLike = 0,
    start: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0),
    sample_time: float = RIG_TIME_S,
) -> FloatArray:
    """Run one controller on many drives.

    Parameters
    ----------
    controller
        Anything with the protocol. A slower one holds its command between its own samples. A black box is copied, so that
        runs in several threads do not share its past.
    drives
        One per job.
    xr : array_like, shape (n,)
        Reference at the rig's samples [mm].
    gains, late : array_like, shape (jobs,) or scalar
        Factor on the command, and whole samples of the rig by which it is held back, for trials of margins.
    start : array_like, shape (4,)
        x1 [mm], v1 [mm/s], x2 [mm], v2 [mm/s].
    sample_time
        Of the rig [s].

    Returns
    -------
    ndarray, shape (jobs, 5, n)
        True x1, v1, x2, v2, and the command as it reaches the drive [V].

    Raises
    ------
    ValueError
        If the controller's sample time is no whole multiple of the rig's, or it answers finite readings with no finite command.
    """
    reference = np.asarray(xr, dtype=np.float64)
    if isinstance(controller, Previewed):
        reference, controller = controller.previewed(reference, sample_time), controller.controller
    if isinstance(controller, LinearController):
        return run_batch(drives, reference, controller, gains=gains, late=late, start=start, sample_time=sample_time)
    jobs = len(drives)
    factor = np.broadcast_to(np.asarray(gains, dtype=np.float64), (jobs,))
    held = np.broadcast_to(np.asarray(late, dtype=np.int64), (jobs,))
    # what previews its reference must hear which it is
    following = getattr(controller, "following", None)
    own = deepcopy(controller if following is None else following(reference))
    # a run that grows beyond all bounds is a result
    with np.errstate(over="ignore", invalid="ignore"):
        if isinstance(own, PolicyController) and runs_in_batch(own):
            if abs(own.sample_time - sample_time) > 1e-6 * sample_time:
                raise ValueError(
                    f"sample_time: the controller is called every {own.sample_time:g} s; the rig runs at {sample_time:g} s. "
                    f"Make it with sample_time={sample_time:g}."
                )
            rigs = Lockstep(drives, sample_time, start)
            return _policies(own, rigs, reference, factor, held)
        runs = [
            _alone(own, Lockstep([drive], sample_time, start), reference, float(factor[j]), int(held[j]))
            for j, drive in enumerate(drives)
        ]
    return np.concatenate(runs)


def runs_in_batch(controller: Controller) -> bool:
    """Whether many runs of a controller cost little more than one."""
    if isinstance(controller, LinearController):
        return True
    return isinstance(controller, PolicyController) and hasattr(controller.policy, "act_many")


def _policies(
    controller: PolicyController, rigs: Lockstep, xr: FloatArray, gains: FloatArray, late: np.ndarray
) -> FloatArray:
    n, jobs, longest = len(xr), len(gains), int(late.max(initial=0))
    policies = PolicyBatch(controller, jobs)
    asked = np.zeros((jobs, longest + n))  # before the run every command was 0
    out = np.empty((jobs, 5, n))
    row = np.arange(jobs)[:, None]
    for i in range(0, n, controller.every):
        m = min(controller.every, n - i)
        asked[:, longest + i : longest + i + m] = policies(float(xr[i]), rigs.readings)[:, None]
        acting = asked[row, longest + i + np.arange(m) - late[:, None]]
        out[:, :, i : i + m] = rigs.advance(gains[:, None] * acting)
    return out


def _alone(controller: Controller, rig: Lockstep, xr: FloatArray, gain: float, late: int) -> FloatArray:
    n = len(xr)
    asked, out = np.zeros(late + n), np.empty((1, 5, n))
    reset = getattr(controller, "reset", None)  # a plain function has no past to forget
    if reset is not None:
        reset()
    for i in range(n):
        x1, x2, v1, v2 = map(float, rig.readings[0])
        u = command_of(controller, Observation(i * rig.sample_time, float(xr[i]), x1, x2, v1, v2))
        asked[late + i] = u if np.isfinite(u) else 0.0
        out[:, :, i : i + 1] = rig.advance(np.array([[gain * asked[i]]]))
    return out
