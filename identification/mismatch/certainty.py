"""How sure the drive of all recordings is: what differs from run to run counts once a run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import f as snedecor
from scipy.stats import t as student

from flexdrive_gym import Covariance, Drive
from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.recording import FloatArray
from identification.mismatch.candidates import Candidate
from identification.mismatch.refit import Coordinates
from identification.mismatch.workbench import Workbench

# a logarithm this uncertain says nothing, and its exponential is still a number
_UNKNOWN = 300.0
# of the largest singular value
_NOTHING = 1e-12


def between_runs(bench: Workbench, J: FloatArray, e: FloatArray, *, left_out: bool) -> FloatArray:
    r"""Return the covariance of a fit from what every recording by itself would move it by.

    Without recording r the estimate moves by :math:`(J^T J - J_r^T J_r)^+ J_r^T \varepsilon_r`; the scores alone move it by
    :math:`(J^T J)^+ J_r^T \varepsilon_r`, which is too little where recordings are few, for each has drawn the fit towards
    itself (R. M. Bell, D. F. McCaffrey, Survey Methodology 28, 2002).

    Parameters
    ----------
    J, e
        Sensitivities, shape (N, n), and residuals at the fit, shape (N,), both among comparable residuals.
    left_out
        Whether to leave out one recording at a time (a jackknife), or to take the scores alone (a sandwich).
    """
    n = len(bench.runs)
    moves = _moves(bench, J, e, left_out=left_out)
    factor = (n - 1) / n if left_out else n / max(n - 1, 1)
    return np.asarray(moves.T @ moves * factor)


def foretold(bench: Workbench, J: FloatArray, e: FloatArray) -> FloatArray:
    """Return the squared error of every recording when the fit is made without it, shape (runs,); linearised."""
    moves, rows = _moves(bench, J, e, left_out=True), [bench.rows.of(r) for r in range(len(bench.runs))]
    return np.array([float(np.sum((e[i] + J[i] @ move) ** 2)) for i, move in zip(rows, moves, strict=True)])


def students_t(x: FloatArray) -> float:
    """Return the mean of a sample over its standard error; 0 for fewer than two numbers or equal ones."""
    spread = float(np.std(x, ddof=1)) if len(x) > 1 else 0.0
    return float(np.mean(x)) / spread * float(np.sqrt(len(x))) if spread else 0.0


def _moves(bench: Workbench, J: FloatArray, e: FloatArray, *, left_out: bool) -> FloatArray:
    """Return how far the fit moves without each recording, or how far each one's score draws it, shape (runs, n)."""
    square = J.T @ J

    def move(r: int) -> FloatArray:
        rows = bench.rows.of(r)
        part = J[rows]
        others = square - part.T @ part if left_out else square
        return np.asarray(np.linalg.pinv(others, rcond=_NOTHING, hermitian=True) @ (part.T @ e[rows]))

    return np.array([move(r) for r in range(len(bench.runs))])


def uncertainty(
    c: Coordinates, values: Mapping[str, float], covariance: FloatArray, n_runs: int
) -> tuple[dict[str, tuple[float, float]], Covariance]:
    """Return 95 % intervals and the covariance in units of the parameters, from that in the fit's coordinates."""
    gain = np.where(c.log, [values[n] for n in c.names], c.scale)
    # a limit at infinity, where it limits nothing, has no spread
    gain = np.where(np.isfinite(gain), gain, 0.0)
    spread = float(student.ppf(0.975, max(n_runs - 1, 1))) * np.sqrt(np.diag(covariance))
    intervals = {
        n: _interval(n, values[n], s, g, log=bool(on)) for n, s, g, on in zip(c.names, spread, gain, c.log, strict=True)
    }
    return intervals, Covariance(tuple(c.names), covariance * np.outer(gain, gain))


def is_there(candidate: Candidate, drive: Drive, *, certain: bool = False) -> bool:
    """Whether an effect's sizes in a drive differ from none, and its shape from the bound at which it is another effect.

    Sizes that are ``certain`` from elsewhere are not asked for again: in a fit of everything, friction and all, they may stand
    where no residual compares them.
    """
    return (certain or differs(candidate, drive)) and not _vanishes(candidate, drive)


def differs(candidate: Candidate, drive: Drive, level: float = 0.05) -> bool:
    """Whether the sizes of an effect together differ from none, by Hotelling's test with the recordings as sample."""
    if drive.covariance is None:
        return True
    names = drive.covariance.names
    sizes = [k for k, _ in candidate.sizes if k in names and np.isfinite(LAYOUT[k].parameter.null)]
    k, n = len(sizes), len(drive.provenance.recordings)
    if not sizes or n <= k + 1:
        return True
    i = [names.index(k) for k in sizes]
    away = np.array([drive[k] - LAYOUT[k].parameter.null for k in sizes])
    distance = float(away @ np.linalg.pinv(drive.covariance.matrix[np.ix_(i, i)], hermitian=True) @ away)
    return distance > k * (n - 1) / (n - k) * float(snedecor.ppf(1.0 - level, k, n - k))


def _vanishes(candidate: Candidate, drive: Drive) -> bool:
    """Whether a shape may be as small as its lower bound, where the effect is another one: stiff bristles are dry friction."""
    shapes = [k for k, _ in candidate.shapes if k in drive.intervals]
    return any(drive.intervals[k][0] <= LAYOUT[k].parameter.lower for k in shapes)


def _interval(name: str, value: float, spread: float, gain: float, *, log: bool) -> tuple[float, float]:
    if log:
        return float(value * np.exp(-spread)), float(value * np.exp(min(spread, _UNKNOWN)))
    low, high = value - spread * gain, value + spread * gain
    if name in LAYOUT:
        low, high = max(low, LAYOUT[name].parameter.lower), min(high, LAYOUT[name].parameter.upper)
    return float(low), float(high)
