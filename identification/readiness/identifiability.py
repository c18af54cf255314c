r"""What recordings can identify: Fisher information of the base model at the best fit.

With residuals that are weighted as in the fit, and their derivatives :math:`J` with respect to *relative* changes of the
parameters, the information of all recordings is

.. math:: F = J^T J \; N_e / N ,

where :math:`N_e` is what the N coloured residuals are worth (:mod:`identification.likelihood`). The standard error of a
parameter is the root of the diagonal of :math:`F^{-1}`.

A parameter is *determined* where its 95 % half width is below a quarter of its value: real rigs of one kind differ by
that much and more, so a parameter that is known less well tells nothing that a value from another rig would not.
Eigenvectors of :math:`F^{-1}` along which the half width is larger are *trade-offs*: their parameters can change
together without the recordings telling. For two parameters p and q with components :math:`w_p, w_q` of such an
eigenvector, :math:`p + c q` with :math:`c = -w_p p / (w_q q)` is what is determined.

Recordings are *ready* where every parameter, or the sum over both carts that it is traded in, is known to within half:
:math:`m_1 + m_2`, k, :math:`b_1 + b_2`, :math:`d_1 + d_2`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.drive.effects import LAYOUT
from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray, Recording
from flexdrive_gym.units import Units
from identification.descent import Descent
from identification.likelihood import MaximumLikelihood, identify_by_likelihood, usable
from identification.recordings.recording_set import RecordingSet
from identification.replay.output_error import prepare
from identification.signals import velocities
from identification.topology import Topology, topology_of

DETERMINED, READY = 0.25, 0.5
# share of an eigenvector that a parameter must have to be named
_TAKES_PART = 0.3
_NORMAL_95 = 1.96
# relative half width beyond which a number says nothing
_NOTHING = 10.0
# a sensitivity below this, of the largest, is none
_BLIND = 1e-7
# share of the command that a friction makes no difference below, and of a like parameter below which one is nearly none
_NEGLIGIBLE, _NEARLY_NONE = 0.2, 0.02
# simulated seconds that the information is taken from
_BUDGET_S = 400.0
_SUMS = {"total mass m1 + m2": ("m1", "m2"), "k": ("k",), "b1 + b2": ("b1", "b2"), "d1 + d2": ("d1", "d2")}


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What recordings determine.

    Attributes
    ----------
    fit
        Best fit of the base model.
    half_width
        Parameter to its relative 95 % half width.
    sizes
        What that is relative to: the parameter's value; where it is nearly none, see :func:`sizes_of`.
    trade_offs
        One sentence for each combination that recordings leave open.
    sums
        What must be known, in words, to its relative 95 % half width.
    fitted, used, available
        Recordings fitted, those the information is taken from, and those a fit can use.
    """

    fit: MaximumLikelihood
    half_width: Mapping[str, float]
    sizes: Mapping[str, float]
    trade_offs: tuple[str, ...]
    sums: Mapping[str, float]
    fitted: int
    used: int
    available: int

    @property
    def determined(self) -> dict[str, bool]:
        """Which parameters are determined."""
        return {name: width < DETERMINED for name, width in self.half_width.items()}

    @property
    def unknown(self) -> list[str]:
        """What must be known and is not."""
        return [name for name, width in self.sums.items() if not width < READY]


def identifiability(
    some: RecordingSet,
    everything: Sequence[Recording],
    units: Units,
    *,
    fit: MaximumLikelihood | None = None,
    threads: int | None = None,
) -> Identifiability:
    """Fit the base model to some recordings and take the information of all.

    Parameters
    ----------
    some
        Recordings to fit, of one rig.
    everything
        Recordings that a fit could use.
    units
        The rig's, for sentences.
    fit
        To those recordings, where there is one already.
    threads
        Of the simulations.

    Raises
    ------
    ValueError
        If no recording can be fitted.
    """
    topology = topology_of(some)
    fit = fit or identify_by_likelihood(some, threads=threads, topology=topology, quick=True)
    chosen, _ = usable(everything)
    counted = _within(chosen, _BUDGET_S)
    names, sizes, covariance = relative_covariance(fit, counted, topology, threads)
    half = half_widths(names, covariance)
    return Identifiability(
        fit,
        half,
        dict(zip(names, map(float, sizes), strict=True)),
        trade_offs(names, sizes, covariance, units),
        _sums(names, sizes, covariance),
        len(some),
        len(counted),
        len(chosen),
    )


def relative_covariance(
    fit: MaximumLikelihood, recordings: Sequence[Recording], topology: Topology, threads: int | None = None
) -> tuple[list[str], FloatArray, FloatArray]:
    """Return the free parameters, what their changes are relative to, and the inverse of the information on these.

    Returns
    -------
    names : list of str
    sizes : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
    """
    values = fit.drive.values
    names = [n for n in topology.free if n in values and n not in topology.fixed]
    sizes = sizes_of(names, values, recordings)
    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        descent = Descent([prepare(r) for r in recordings], names, {}, topology.fixed, pool)
        descent.scale = sizes
        z = descent.coordinates(values)
        descent.reweight(z)
        J = descent.jacobian(z)
    worth = min(1.0, fit.effective_samples / max(fit.samples, 1))
    felt = np.linalg.norm(J, axis=0)
    seen = felt > _BLIND * max(float(np.max(felt)), 1e-300)
    covariance = np.diag(np.where(seen, 0.0, _NOTHING**2))
    information = J[:, seen].T @ J[:, seen] * worth
    covariance[np.ix_(seen, seen)] = np.linalg.pinv(information, rcond=1e-14, hermitian=True)
    return names, sizes, covariance


def half_widths(names: Sequence[str], covariance: FloatArray) -> dict[str, float]:
    """Return every parameter's relative 95 % half width."""
    return {n: _NORMAL_95 * float(np.sqrt(max(c, 0.0))) for n, c in zip(names, np.diag(covariance), strict=True)}


def _within(recordings: Sequence[Recording], seconds: float) -> list[Recording]:
    """Return evenly chosen recordings that last so long in all."""
    lengths = [r.n * r.sample_time for r in recordings]
    every = max(1, int(np.ceil(sum(lengths) / seconds)))
    return list(recordings[::every])


def sizes_of(names: Sequence[str], values: Mapping[str, float], recordings: Sequence[Recording]) -> FloatArray:
    """Return what parameters' changes are relative to: their values.

    A friction that is nearly none is relative to the same friction of both carts; where that is none either, to a fifth of the
    command that the recordings have, because less than that makes no difference. Another effect that is none is relative to its
    usual size.

    Returns
    -------
    ndarray, shape (p,)
    """
    level = _NEGLIGIBLE * float(np.median([np.max(np.abs(r.u)) for r in recordings]))
    speed = max(float(np.median([max(np.max(np.abs(v)) for v in velocities(r)) for r in recordings])), 1e-9)
    least = {"d": level, "b": level / speed}
    found = []
    for name in names:
        value = abs(values[name])
        if len(name) > 2:
            starts = LAYOUT[name].parameter.starts
            found.append(value or abs(starts[0] if starts else 1.0) or 1.0)
            continue
        both = sum(abs(v) for n, v in values.items() if len(n) == 2 and n[0] == name[0])
        usual = max(both, least.get(name[0], 0.0)) or 1.0
        found.append(value if value > _NEARLY_NONE * usual else usual)
    return np.array(found)


def _sums(names: Sequence[str], sizes: FloatArray, covariance: FloatArray) -> dict[str, float]:
    found = {}
    for words, parts in _SUMS.items():
        have = [names.index(p) for p in parts if p in names]
        if not have:
            continue
        weights = sizes[have] / np.sum(sizes[have])
        variance = float(weights @ covariance[np.ix_(have, have)] @ weights)
        label = words if len(have) == len(parts) else names[have[0]]
        found[label] = _NORMAL_95 * float(np.sqrt(max(variance, 0.0)))
    return found


def trade_offs(names: Sequence[str], sizes: FloatArray, covariance: FloatArray, units: Units) -> tuple[str, ...]:
    """Return a sentence for each combination of parameters that is not determined, the widest first.

    Parameters
    ----------
    names
        Of the parameters.
    sizes
        What their changes are relative to, ndarray, shape (p,).
    covariance
        Of relative changes, ndarray, shape (p, p).
    units
        The rig's.
    """
    variances, directions = np.linalg.eigh(covariance)
    open_ = list(half_widths(names, covariance).values())
    found = []
    for variance, w in sorted(zip(variances, directions.T, strict=True), key=lambda item: -item[0]):
        half = _NORMAL_95 * float(np.sqrt(max(variance, 0.0)))
        if half < DETERMINED:
            break
        parts = [int(i) for i in np.argsort(-np.abs(w)) if abs(w[i]) > _TAKES_PART]
        parts = sorted(parts) if len(parts) == 2 else parts
        if all(open_[i] < DETERMINED for i in parts):
            continue
        found.append(_sentence([names[i] for i in parts], w[parts], sizes[parts], half, units))
    return tuple(dict.fromkeys(found))


def short(name: str) -> str:
    """Return a parameter's own name, without effect and place."""
    return name.rsplit(".", 1)[-1]


def _sentence(names: Sequence[str], w: FloatArray, sizes: FloatArray, half: float, units: Units) -> str:
    """Say which parameters can change together, and what of two is determined."""
    if len(names) == 1:
        width = f"by {half:.0%}" if half < _NOTHING else "by any amount"
        return f"{short(names[0])} alone: may be wrong {width}, and no other parameter makes up for it"
    listed = ", ".join(map(short, names[:-1])) + f" and {short(names[-1])}"
    w = w * np.sign(w[0])
    if len(names) == 2:
        one, other = (units.one(parameter(n).unit) for n in names)
        factor = -float(w[0] * sizes[0] / one / (w[1] * sizes[1] / other))
        sign = "+" if factor > 0.0 else "−"
        size = abs(factor)
        weight = "" if abs(size - 1.0) < 0.05 else f"{float(f'{size:.2g}'):g}·"
        return f"{listed}: only {short(names[0])} {sign} {weight}{short(names[1])} is determined"
    changes = [f"{short(n)} {0.1 * x / w[0]:+.0%}" for n, x in zip(names, w, strict=True)]
    return f"{listed}: only together; {changes[0]} is made up for by {', '.join(changes[1:])}"


__all__ = [
    "DETERMINED",
    "READY",
    "Identifiability",
    "half_widths",
    "identifiability",
    "relative_covariance",
    "short",
    "sizes_of",
    "trade_offs",
]
