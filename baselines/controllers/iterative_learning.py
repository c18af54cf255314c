r"""The command a drive asks for along a reference, with all its physics: learnt by repeating the run on the model.

A linear feed-forward knows masses and dampers. Friction with its law, a dead zone, play, a limit, delays and the like have no
inverse that could be written down once for all of them, but the drive itself says what they need: simulate the loop, look at
the error :math:`e = x_r - x_2` that is left, and change the command by what would have removed it,

.. math:: a_{j+1} = a_j + \ell\, Q\, S_d^{-1} e_j,

with :math:`S_d` the linear response from a disturbance at the command to x2 and Q a low pass without phase (iterative learning
control; D. A. Bristow, M. Tharayil, A. G. Alleyne, IEEE Control Systems Magazine 26(3), 2006). The best of all repetitions is
kept, the one without any change among them. Nothing is measured: the rig gets a command that was learnt on its model, so it is
worth what the model is worth.

Where a run starts on the track is not known to the model. Effects whose phase or place is bound to the track are therefore left
out: a ripple compensated at the wrong phase would double it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from baselines.controllers import effective
from baselines.loop_analysis.loops import closed_loop_response
from flexdrive_gym import Drive, LinearController
from flexdrive_gym.drive.batch.closed_loop import run_batch
from flexdrive_gym.recording import FloatArray

REPETITIONS = 20
LEARNING = 0.5
BAND_HZ = 6.0
# a linear response smaller than this share of its largest is not inverted
_SMALLEST = 1e-3
_BOUND_TO_THE_TRACK = ("cogging", "position_friction", "encoder_eccentricity")


def learn_feedforward(drive: Drive, controller: LinearController, xr: npt.ArrayLike) -> FloatArray:
    """Return what to add to a controller's command along a reference.

    Parameters
    ----------
    drive
        The model, with all its effects.
    controller
        That runs the loop; a linear one, designed for this drive.
    xr : array_like, shape (n,)
        Reference at control periods [mm].

    Returns
    -------
    ndarray, shape (n,)
        [V]; zeros where no repetition beats the controller alone.
    """
    reference = np.asarray(xr, dtype=np.float64)
    n = len(reference)
    model = Drive(
        {k: v for k, v in drive.values.items() if k.split(".")[0] not in _BOUND_TO_THE_TRACK}, name=drive.name
    )
    row = 2 if drive.carts == 2 else 0
    learn = _learning_filter(effective(model, ("x2",)), controller, 2 * n)
    command, best, least = np.zeros(n), np.zeros(n), np.inf
    for _ in range(REPETITIONS):
        e = reference - run_batch([model], reference, controller, disturbance=command)[0, row]
        size = float(np.sqrt(np.mean(e**2)))
        if size < least:
            best, least = command, size
        # the run is repeated backwards behind itself, so that the period has no jump
        change = np.fft.irfft(learn * np.fft.rfft(np.concatenate([e, e[::-1]])), 2 * n)[:n]
        command = command + change
    return best


def _learning_filter(drive: Drive, controller: LinearController, n: int) -> npt.NDArray[np.complex128]:
    """Return ℓ·Q/S_d at the frequencies of a real Fourier transform of n samples."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, controller.sample_time)
    used = omega < 2.0 * np.pi * 4.0 * BAND_HZ
    S = closed_loop_response(drive, controller, np.maximum(omega[used], omega[1]))[:, 1 if drive.carts == 2 else 0, 1]
    Q = np.exp(-((omega[used] / (2.0 * np.pi * BAND_HZ)) ** 2))
    floor = _SMALLEST * np.max(np.abs(S))
    found = np.zeros(len(omega), dtype=np.complex128)
    found[used] = LEARNING * Q * np.conj(S) / (np.abs(S) ** 2 + floor**2)
    return found
