"""The handout's quantities (3.5) of any drive, with intervals carried over from the parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym import Drive
from flexdrive_gym.units import Units

UNITS = {
    "bT": "V s/mm", "b1": "V s/mm", "b2": "V s/mm", "dT": "V", "d1": "V", "d2": "V", "p": "1/s",
    "mT": "V s²/mm", "m1": "V s²/mm", "m2": "V s²/mm", "omega_d": "rad/s", "k": "V/mm", "zeta": "",
    "omega_n": "rad/s", "C": "V s/mm",
}  # fmt: skip
# the handout's ratios: what over what, and the values it assumes (3.1)
RATIOS = {"alpha": ("m2", "m1"), "beta": ("b2", "b1"), "gamma": ("d2", "d1")}
HANDOUT_RATIOS = {"alpha": 0.54, "beta": 0.1, "gamma": 0.1}


@dataclass(frozen=True)
class Quantity:
    """A number with its unit, how it was found, and what is known of its error.

    Attributes
    ----------
    value, unit
        In the handout's units, unless :meth:`of_rig` made them the rig's.
    how
        A few words on the method or reading.
    standard_error
        Where known, else ``None``.
    ci95
        95 % confidence interval where known, else ``None``.
    """

    value: float
    unit: str
    how: str = ""
    standard_error: float | None = None
    ci95: tuple[float, float] | None = None

    def of_rig(self, units: Units) -> Quantity:
        """Return the quantity as its rig's owner reads it."""
        if units.lab:
            return self
        one = units.one(self.unit)
        return replace(
            self,
            value=self.value / one,
            unit=units.name(self.unit),
            standard_error=None if self.standard_error is None else self.standard_error / one,
            ci95=None if self.ci95 is None else (self.ci95[0] / one, self.ci95[1] / one),
        )

    def __str__(self) -> str:
        text = f"{self.value:.5g} {self.unit}".rstrip()
        if self.ci95 is not None:
            text += f"  [{self.ci95[0]:.4g}, {self.ci95[1]:.4g}]"
        return text


def compute(drive: Drive) -> dict[str, float]:
    """Return the quantities of handout 3.5 for a drive; those of the second cart are absent for a rigid drive.

    ``p``, ``omega_n``, ``zeta`` and ``omega_d`` are those of the exact poles, not of Eq. (6).
    """
    linear = drive.linear
    two = drive.carts == 2
    m2, b2, d2 = (drive["m2"], drive["b2"], drive["d2"]) if two else (0.0, 0.0, 0.0)
    result = {
        "bT": drive["b1"] + b2, "b1": drive["b1"], "b2": b2,
        "dT": drive["d1"] + d2, "d1": drive["d1"], "d2": d2,
        "p": linear.p,
        "mT": drive["m1"] + m2, "m1": drive["m1"], "m2": m2,
        "omega_d": linear.omega_d, "k": drive["k"], "zeta": linear.zeta, "omega_n": linear.omega_n, "C": drive["C"],
    }  # fmt: skip
    if not two:
        for name in ("b2", "d2", "m2", "omega_d", "k", "zeta", "omega_n", "C"):
            del result[name]
    return result


def ratios(drive: Drive) -> dict[str, float]:
    """Return alpha = m2/m1, beta = b2/b1, gamma = d2/d1 (nan where a denominator is 0)."""
    if drive.carts == 1:
        return {}
    # a friction that rests at its bound is zero up to the optimiser's distance from it
    return {n: drive[a] / drive[b] if drive[b] > 1e-3 * drive[a] else float("nan") for n, (a, b) in RATIOS.items()}


def derived_quantities(
    drive: Drive, ties: Mapping[str, float], quantile: float
) -> tuple[dict[str, Quantity], dict[str, Quantity]]:
    """Return quantities and ratios with 95 % intervals: a parameter's is the drive's own, all others by the delta method."""
    centre = {**compute(drive), **ratios(drive)}
    gradient = _gradient(drive, centre, ties)
    result = {}
    for name, value in centre.items():
        spread = None
        if drive.covariance is not None:
            row = gradient[name]
            spread = float(np.sqrt(max(0.0, row @ drive.covariance.matrix @ row)))
        known = spread is not None and spread > 0.0
        result[name] = Quantity(
            value,
            UNITS.get(name, ""),
            "tied" if name in ties else "maximum likelihood" if known else "assumed",
            spread if known else None,
            _interval(drive, name, value, quantile * spread) if known and spread is not None else None,
        )
    found = {n: q for n, q in result.items() if n not in RATIOS}
    return found, {n: q for n, q in result.items() if n in RATIOS}


def _interval(drive: Drive, name: str, value: float, half: float) -> tuple[float, float]:
    """Return the one interval that there is for a quantity; none of them can be negative."""
    if name in drive.intervals:
        low, high = drive.intervals[name]
        return float(low), float(high)
    return max(0.0, value - half), value + half


def _gradient(drive: Drive, centre: Mapping[str, float], ties: Mapping[str, float]) -> dict[str, np.ndarray]:
    names = drive.covariance.names if drive.covariance is not None else ()
    columns = []
    for name in names:
        step = 1e-4 * max(abs(drive[name]), 1e-6)
        changes = {name: drive[name] + step}
        for tie, factor in ties.items():
            follows, free = RATIOS[tie]
            if free == name:
                changes[follows] = factor * changes[name]
        moved = drive.replace(changes)
        there = {**compute(moved), **ratios(moved)}
        columns.append([(there[q] - centre[q]) / step for q in centre])
    table = np.array(columns).T if columns else np.zeros((len(centre), 0))
    return dict(zip(centre, table, strict=True))
