r"""Is the size of a parameter the same in all sessions? What changed between them is a finding.

Around the final optimum, the recordings of session s alone ask for the step
:math:`\Delta_s = -(H_s + \rho \operatorname{diag} H)^{-1} g_s`. For every parameter the spread of these steps, weighted by the
sessions' information, is compared with that of sessions drawn by permuting the recordings' labels: recordings of one session then
differ only as recordings do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.fitting.fit import Fit
from identification.mismatch.fitting.score import Normal

# permutations of the labels; the least p-value is one in so many
_PERMUTATIONS = 499
# recordings a session must have for its own estimate
_FEWEST = 3
# share of the common information that keeps a session from moving what it says nothing about
_RIDGE = 0.02


@dataclass(frozen=True)
class Homogeneity:
    """One parameter held against the sessions.

    Attributes
    ----------
    parameter
        Its name.
    p_value
        Of the hypothesis that it is the same in all sessions.
    values
        Session to the value its recordings ask for.
    statement
        One sentence.
    """

    parameter: str
    p_value: float
    values: Mapping[str, float]
    statement: str

    def as_json(self) -> dict[str, object]:
        """Return the entry of ``diagnosis.json``."""
        return {
            "parameter": self.parameter,
            "across": "sessions",
            "p_value": self.p_value,
            "values": dict(self.values),
            "statement": self.statement,
        }


def homogeneity(
    model: Fit, sessions: Sequence[str], alpha: float, rng: np.random.Generator, one: Mapping[str, float]
) -> list[Homogeneity]:
    """Hold every parameter of a model against the sessions of its recordings.

    Parameters
    ----------
    model
        Fit of all recordings.
    sessions
        Session of each recording, in the order of the fit's rows.
    alpha
        Level, shared by all parameters.
    rng
        Of the permutations.
    one
        Parameter to the engine's units in one of the rig's, which values are told in.

    Returns
    -------
    list of Homogeneity
        One per parameter that does not rest at a bound; empty for a single session or very short ones.
    """
    labels = np.array(sessions)
    names = [str(s) for s in np.unique(labels)]
    if len(names) < 2 or min(int(np.sum(labels == s)) for s in names) < _FEWEST:
        return []
    n = model.normal
    steps = _steps(n, labels, names)
    own = _spread(n, labels, names, steps)
    drawn = []
    for _ in range(_PERMUTATIONS):
        mixed = rng.permutation(labels)
        drawn.append(_spread(n, mixed, names, _steps(n, mixed, names)))
    p = (1.0 + np.sum(np.array(drawn) >= own, axis=0)) / (_PERMUTATIONS + 1.0)
    inner = [(name, s) for name, s, i in zip(model.names, model.scale, model.interior, strict=True) if i]
    found = []
    for i, (name, scale) in enumerate(inner):
        values = {s: float((model.values[name] + scale * steps[j, i]) / one[name]) for j, s in enumerate(names)}
        differs = p[i] <= alpha / len(inner)
        each = ", ".join(f"{v:.3g} in {s}" for s, v in values.items())
        text = (
            f"{name} changed between sessions: {each}."
            if differs
            else f"{name} is the same in all sessions within its uncertainty."
        )
        found.append(Homogeneity(name, float(p[i]), values, text))
    return found


def _steps(n: Normal, labels: FloatArray, names: Sequence[str]) -> FloatArray:
    common = n.information.sum(axis=0)
    ridge = _RIDGE * np.diag(np.diag(common)) + 1e-12 * np.trace(common) * np.eye(len(common))
    return np.array(
        [
            -np.linalg.solve(n.information[labels == s].sum(axis=0) + ridge, n.gradient[labels == s].sum(axis=0))
            for s in names
        ]
    )


def _spread(n: Normal, labels: FloatArray, names: Sequence[str], steps: FloatArray) -> FloatArray:
    weight = np.array([np.diag(n.information[labels == s].sum(axis=0)) for s in names])
    weight = weight / np.maximum(weight.sum(axis=0), 1e-300)
    mean = np.sum(weight * steps, axis=0)
    return np.asarray(np.sum(weight * (steps - mean) ** 2, axis=0))
