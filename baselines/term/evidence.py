r"""What every single run says of the drive's parameters, as a quadratic log-likelihood around the group's own fit.

With :math:`\theta` the logarithms of the parameters, :math:`J_g` the derivatives of run g's weighted residuals :math:`r_g` and
:math:`\theta_0` the group's estimate,

.. math:: \ell_g(\theta) \simeq u_g^T (\theta - \theta_0) - \tfrac12 (\theta - \theta_0)^T A_g (\theta - \theta_0), \qquad
          A_g = J_g^T J_g / \kappa, \quad u_g = -J_g^T r_g / \kappa .

Neighbouring residuals are correlated, so their nominal information is too large by
:math:`\kappa = \operatorname{tr}\bigl[(\sum_g J_g^T J_g)^{-1} \sum_p s_p s_p^T\bigr] / n`, the mean ratio of the scores' actual
covariance to the nominal one, with :math:`s_p` the scores of pieces of a second, centred within each run: what a run errs by as a
whole is what runs differ by, and that is asked later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.recording import FloatArray, Recording
from identification.descent import Descent
from identification.likelihood import usable
from identification.replay.output_error import prepare

_PIECE_S = 1.0
# a friction that rests at zero has no logarithm [of the largest of its kind]
_NOTHING = 1e-3


@dataclass(frozen=True, eq=False)
class RunEvidence:
    """What one run says of the logarithms of the parameters.

    Attributes
    ----------
    recording, session
        Names.
    information : ndarray, shape (n, n)
        A; its inverse is the covariance of what the run alone would estimate.
    score : ndarray, shape (n,)
        Slope of the log-likelihood at the logarithms of zero itself, A·θ0 + u, so that the values need not be known.
    """

    recording: str
    session: str
    information: FloatArray
    score: FloatArray

    def as_json(self) -> dict[str, Any]:
        """Return it as plain lists, to seven digits."""
        return {
            "recording": self.recording,
            "session": self.session,
            "information": [[float(f"{x:.7g}") for x in row] for row in self.information],
            "score": [float(f"{x:.7g}") for x in self.score],
        }

    @classmethod
    def from_json(cls, found: Mapping[str, Any]) -> RunEvidence:
        """Return what :meth:`as_json` gave."""
        return cls(found["recording"], found["session"], np.array(found["information"]), np.array(found["score"]))


def run_evidence(
    drive: Drive, recordings: Sequence[Recording], sessions: Mapping[str, str], threads: int = 1
) -> tuple[tuple[str, ...], tuple[RunEvidence, ...]]:
    """Return the parameters that the evidence is about, and what each run says.

    Parameters
    ----------
    drive
        As identified from the recordings, with its covariance.
    recordings
        Those that a fit can use.
    sessions
        Name of a recording to its session.
    threads
        Of the simulations.
    """
    assert drive.covariance is not None
    names = drive.covariance.names
    used, _ = usable(recordings)
    runs = [prepare(r) for r in used]
    fixed = {n: v for n, v in drive.values.items() if n not in names}
    with ThreadPoolExecutor(threads) as pool:
        descent = Descent(runs, names, {}, fixed, pool)
        z = descent.coordinates(drive.values)
        descent.reweight(z)
        J, r = descent.jacobian(z), descent.residuals(z)
    theta = np.array([drive[n] for n in names])
    # coordinates are logarithms, or values over a scale of 1
    J = J * np.where(descent.log, 1.0, theta / descent.scale)
    kinds = [name[0] for name in names]
    known = np.array([
        abs(x) > _NOTHING * max(abs(y) for y, k in zip(theta, kinds, strict=True) if k == kind)
        for x, kind in zip(theta, kinds, strict=True)
    ])  # fmt: skip
    J, theta, names = J[:, known], theta[known], tuple(n for n, k in zip(names, known, strict=True) if k)
    nominal, slopes, spread = [], [], np.zeros((len(names), len(names)))
    begin = 0
    for run in runs:
        pieces = np.zeros((int(len(run.u) * run.sample_time / _PIECE_S) + 1, len(names)))
        H = np.zeros_like(spread)
        for c in range(len(run.keep)):
            at = (run.block_times(c) / _PIECE_S).astype(int)
            rows = slice(begin, begin + len(at))
            np.add.at(pieces, at, -J[rows] * r[rows, None])
            H += J[rows].T @ J[rows]
            begin += len(at)
        nominal.append(H)
        slopes.append(pieces.sum(axis=0))
        n = len(pieces)
        centred = pieces - pieces.mean(axis=0)
        spread += centred.T @ centred * (n / max(n - 1, 1))
    total = np.sum(nominal, axis=0)
    inflation = max(1.0, float(np.trace(np.linalg.pinv(total, rcond=1e-12, hermitian=True) @ spread)) / len(names))
    at_zero = np.log(theta)
    return names, tuple(
        RunEvidence(run.name, sessions.get(run.name, ""), H / inflation, (H @ at_zero + u) / inflation)
        for run, H, u in zip(runs, nominal, slopes, strict=True)
    )
