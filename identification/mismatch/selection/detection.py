r"""Below which size an effect cannot be seen in these recordings.

What is not named is not absent. With the information :math:`s_u` that an experiment has of a size beside the base model, an
effect of size a is expected to gain :math:`a^2 s_u / 2` units of log-likelihood there. Below the size at which that gain, without
the experiment that gains most, is significant, most data sets do not show the effect. Of an effect along the track, whose phase
differs from run to run, an amplitude a gains :math:`\ln I_0(a^2 h_r) - a^2 h_r / 2`.

This is of first order, around the size at which the sensitivity was taken, and in the noise of these recordings: a track that
is rough, or friction that differs from run to run, hides what is like it. It is a bound: what friction makes of an effect is less
than first order has it, and a gain is not yet a name, for it is asked whether a simulation needs it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import i0e

from flexdrive_gym.drive.parameters import parameter
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units
from identification.mismatch.candidates.catalogue import Candidate
from identification.mismatch.candidates.phases import Phase
from identification.mismatch.fitting.experiments import IntArray
from identification.mismatch.fitting.score import scaled, shared
from identification.mismatch.selection.evaluate import Name
from identification.mismatch.selection.linear import Entry, Linear
from identification.mismatch.selection.null import Null

# between which amplitudes of a phase a limit is looked for, over that of one unit of information
_AMPLITUDES = (1e-3, 1e4)


@dataclass(frozen=True)
class DetectionLimit:
    """The size below which these recordings do not show an effect.

    Attributes
    ----------
    id, where
        Effect and place, of the catalogue.
    parameter, value, unit
        Its size, and the bound; ``inf`` where no size within its own bounds is seen.
    usual
        What it usually is on a rig of this scale, where it is plainly present [unit].
    shape
        Its other parameters, in which it is seen most easily: short name to value and unit.
    """

    id: str
    where: str
    parameter: str
    value: float
    unit: str
    usual: float
    shape: Mapping[str, tuple[float, str]]

    @property
    def name(self) -> str:
        """``effect@place``, as of a finding."""
        return f"{self.id}@{self.where}"

    def of_rig(self, units: Units) -> DetectionLimit:
        """Return the limit as the rig's owner reads it."""
        shape = {n: (v / units.one(u), units.name(u)) for n, (v, u) in self.shape.items()}
        one = units.one(self.unit)
        return replace(self, value=self.value / one, usual=self.usual / one, unit=units.name(self.unit), shape=shape)

    def as_json(self) -> dict[str, object]:
        """Return the entry of ``diagnosis.json``."""
        shape = {n: {"value": v, "unit": u} for n, (v, u) in self.shape.items()}
        own = {"id": self.id, "where": self.where, "parameter": self.parameter}
        return {**own, "value": self.value, "unit": self.unit, "usual": self.usual, "shape": shape}


def detection_limits(linear: Linear, null: Null, level: float) -> tuple[DetectionLimit, ...]:
    """Return the least size of every candidate that acts in proportion to it, one for every size that it has.

    Parameters
    ----------
    linear
        All candidates around the present model.
    null
        Null distribution of their gains.
    level
        Of the test.
    """
    phased = {e.candidate.name: float("nan") for e in linear.entries if isinstance(e.candidate, Phase)}
    phased |= {
        c.name: c.sizes[0][1]
        for c in (e.candidate for e in linear.entries)
        if isinstance(c, Candidate) and c.name in phased
    }
    found: dict[tuple[str, ...], DetectionLimit] = {}
    for limit in (_limit(linear, null, level, e, phased) for e in linear.entries):
        if limit is not None:
            key = limit.id, limit.where, limit.parameter
            if key not in found or limit.value < found[key].value:
                found[key] = limit
    return tuple(found.values())


def _limit(
    linear: Linear, null: Null, level: float, entry: Entry, phased: Mapping[Name, float]
) -> DetectionLimit | None:
    candidate = entry.candidate
    if isinstance(candidate, Phase):
        gain = null.needed(candidate.name, level)
        unit = "mm" if candidate.where.startswith("encoder") else "V"
        value = amplitude(_of_phases(linear, entry.columns), linear.bench.units, gain)
        usual = phased[candidate.name]
        return DetectionLimit(*candidate.name, "amplitude", value, unit, usual, {"P": (candidate.period, "mm")})
    if not isinstance(candidate, Candidate) or len(candidate.sizes) != 1:
        return None
    if not candidate.proportional or candidate.name in phased:
        return None
    (key, usual), information = candidate.sizes[0], float(shared(_beside_base(linear, entry.columns[0])))
    value = np.sqrt(2.0 * null.needed(candidate.name, level) / information) if information > 0.0 else np.inf
    shape = {k.rsplit(".", 1)[-1]: (v, parameter(k).unit) for k, v in candidate.shapes}
    own, q = key.rsplit(".", 1)[-1], parameter(key)
    return DetectionLimit(*candidate.name, own, float(value) if value <= q.upper else np.inf, q.unit, abs(usual), shape)


def _beside_base(linear: Linear, column: int) -> FloatArray:
    """Return the information that every unit has of a column beside the base model, shape (U,)."""
    use = [*linear.base, column]
    P = linear.products[:, use][:, :, use]
    A, d = scaled(P[:, :-1, :-1].sum(axis=0), linear.bench.settings.damping)
    beside = np.append(-np.linalg.solve(A, P[:, :-1, -1].sum(axis=0) / d) / d, 1.0)
    return np.asarray(np.einsum("i,uij,j->u", beside, P, beside))


def _of_phases(linear: Linear, columns: Sequence[int]) -> FloatArray:
    """Return the information that every recording has of either column of a ripple, turned to one size, shape (R,)."""
    S = [linear.white[rows][:, list(columns)].astype(np.float64) for rows in linear.bench.rows]
    return np.sqrt(np.maximum([np.linalg.det(s.T @ s) for s in S], 0.0))


def amplitude(information: FloatArray, units: IntArray, gain: float) -> float:
    """Return the amplitude from which on a ripple of another phase in every recording is expected to gain so much.

    Parameters
    ----------
    information : ndarray, shape (R,)
        Of a recording's sine and cosine each.
    units : ndarray of int, shape (R,)
        Which experiment a recording belongs to.
    """
    if not np.any(information > 0.0):
        return float("inf")
    typical = 1.0 / np.sqrt(information.max())

    def more(size: float) -> float:
        x = (np.exp(size) * typical) ** 2 * information
        return float(shared(np.bincount(units, np.log(i0e(x)) + 0.5 * x).astype(np.float64))) - gain

    low, high = np.log(_AMPLITUDES)
    return float(np.exp(brentq(more, low, high)) * typical) if more(high) > 0.0 else float("inf")
