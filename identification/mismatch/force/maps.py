"""Locating: the missing force of every cart against everything it could depend on.

A *map* is the mean missing force in bins of one variable. How much it says is the share of the missing force it predicts in
recordings that were left out when the means were taken, so that a map of noise says nothing or less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexdrive_gym.recording import FloatArray, Recording
from flexdrive_gym.units import LAB, Units
from identification.mismatch.force.missing_force import MissingForce

BINS = 24
# share of a missing force that a variable must predict for the force to be said to follow it
_FOLLOWS = 0.02
UNITS = {"v1": "mm/s", "v2": "mm/s", "δ": "mm", "u": "V", "x1": "mm", "x2": "mm", "t": "s"}


@dataclass(frozen=True, eq=False)
class Map:
    """Mean missing force against one variable.

    Attributes
    ----------
    where
        ``cart_1`` or ``cart_2``: whose equation misses the force.
    variable
        One of :data:`UNITS`.
    centre, mean, band : ndarray, shape (bins,)
        Median of the variable, mean missing force and its standard error over recordings [V].
    explained
        Share of the missing force predicted in recordings left out; can be negative.
    size
        Rms of the missing force [V].
    """

    where: str
    variable: str
    centre: FloatArray
    mean: FloatArray
    band: FloatArray
    explained: float
    size: float
    units: Units = LAB

    def of_rig(self, units: Units) -> Map:
        """Return the map as the rig's owner reads it."""
        one, force = units.one(UNITS[self.variable]), units.one("V")
        return replace(
            self,
            centre=self.centre / one,
            mean=self.mean / force,
            band=self.band / force,
            size=self.size / force,
            units=Units(units.length, units.command),
        )

    @property
    def sentence(self) -> str:
        """What the map says."""
        i = int(np.argmax(np.abs(self.mean)))
        at = f"{self.centre[i]:.3g} {self.units.name(UNITS[self.variable])}"
        if self.explained < _FOLLOWS:
            return (
                f"the force missing on {_cart(self.where)} is not predicted by {self.variable} in recordings left out"
            )
        return (
            f"{self.explained:.0%} of the force missing on {_cart(self.where)} follows {self.variable}; "
            f"it is largest, {self.mean[i]:+.3g} {self.units.command}, at {self.variable} = {at}"
        )


def _cart(where: str) -> str:
    return where.replace("_", " ")


def variables(force: MissingForce) -> dict[str, FloatArray]:
    """Return everything a missing force is drawn against, each of shape (n,)."""
    found = {"v1": force.v[0], "x1": force.x[0], "u": force.u, "t": force.t}
    if len(force.v) == 2:
        found |= {"v2": force.v[1], "x2": force.x[1], "δ": force.delta}
    return found


def draw_maps(forces: Sequence[MissingForce]) -> list[Map]:
    """Draw every cart's missing force against every variable, most telling first."""
    carts = len(forces[0].g)
    maps = []
    for cart in range(carts):
        for name in variables(forces[0]):
            found = _map(forces, cart, name)
            if found is not None:
                maps.append(found)
    return sorted(maps, key=lambda m: -m.explained * m.size**2)


def _map(forces: Sequence[MissingForce], cart: int, name: str) -> Map | None:
    x = [variables(f)[name][f.usable[cart]] for f in forces]
    g = [f.g[cart][f.usable[cart]] for f in forces]
    everything = np.concatenate(x)
    if len(everything) < 10 * BINS:
        return None
    edges = np.unique(np.quantile(everything, np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
    bins = len(edges) + 1
    place = [np.digitize(values, edges) for values in x]
    count = np.array([np.bincount(p, minlength=bins) for p in place], dtype=float)
    total = np.array([np.bincount(p, weights=w, minlength=bins) for p, w in zip(place, g, strict=True)])
    n, s = count.sum(axis=0), total.sum(axis=0)
    mean = s / np.maximum(n, 1.0)
    overall = float(s.sum() / n.sum())
    # what the other recordings predict for this one; where they never were they predict their overall mean
    others, weight = s - total, n - count
    whole = (others.sum(axis=1) / np.maximum(weight.sum(axis=1), 1.0))[:, None]
    predicted = np.where(weight > 0.0, others / np.maximum(weight, 1.0), whole)
    squares = sum(float(w @ w) for w in g)
    left = squares - float(np.sum(2.0 * predicted * total - predicted**2 * count))
    own = np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)
    runs = np.maximum(np.sum(count > 0.0, axis=0), 1)
    band = np.sqrt(np.nansum((own - mean) ** 2, axis=0) / np.maximum(runs - 1, 1) / runs)
    order = np.concatenate(place)
    centre = np.array([np.median(everything[order == i]) if (order == i).any() else np.nan for i in range(bins)])
    variance = squares - overall**2 * float(n.sum())
    return Map(
        f"cart_{cart + 1}",
        name,
        centre,
        mean,
        band,
        1.0 - left / max(variance, 1e-300),
        float(np.sqrt(squares / n.sum())),
    )


@dataclass(frozen=True)
class Located:
    """Where the base model's error is: whose equation lacks a force, and what that force follows."""

    where: str
    share_of_error: float
    acts_on: str
    evidence: str


def located(maps: Sequence[Map]) -> tuple[Located, ...]:
    """Return each equation's share of the missing force and the variable it follows most."""
    sizes = {m.where: m.size**2 for m in maps}
    everything = sum(sizes.values())
    found = []
    for where, square in sorted(sizes.items(), key=lambda item: -item[1]):
        best = max((m for m in maps if m.where == where), key=lambda m: m.explained)
        i = int(np.argmax(np.abs(best.mean)))
        unit = best.units.name(UNITS[best.variable])
        acts = f"{best.variable} near {best.centre[i]:.3g} {unit}" if best.explained > _FOLLOWS else "no single signal"
        found.append(Located(where, float(square / everything), acts, best.sentence))
    return tuple(found)


@dataclass(frozen=True)
class Harmonics:
    """Harmonics of the command in the missing force of one periodic recording.

    Attributes
    ----------
    frequency
        Of the command [Hz].
    amplitude
        Of harmonics 1 to 5 [V].
    unit
        Of the amplitudes.
    """

    recording: str
    where: str
    frequency: float
    amplitude: tuple[float, ...]
    unit: str = "V"

    def of_rig(self, units: Units) -> Harmonics:
        """Return the harmonics as the rig's owner reads them."""
        force = units.one(self.unit)
        return replace(
            self,
            frequency=self.frequency / units.one("Hz"),
            amplitude=tuple(a / force for a in self.amplitude),
            unit=units.name(self.unit),
        )

    @property
    def even(self) -> float:
        """Share of the power that even harmonics carry: nothing odd in u makes them."""
        power = np.array(self.amplitude) ** 2
        return float((power[1] + power[3]) / max(power.sum(), 1e-300))


def harmonics(forces: Sequence[MissingForce], recordings: Sequence[Recording]) -> list[Harmonics]:
    """Return the harmonics of every sine recording's missing forces."""
    found = []
    for force, recording in zip(forces, recordings, strict=True):
        f = recording.excitation.frequency
        if recording.excitation.kind != "sine" or not f > 0.0:
            continue
        h = float(force.t[1] - force.t[0])
        n = int(int(len(force.t) * h * f) / f / h)
        phase = np.exp(-2j * np.pi * f * force.t[:n, None] * np.arange(1, 6)[None, :])
        for cart in range(len(force.g)):
            amplitude = 2.0 * np.abs(force.g[cart][:n] @ phase) / max(n, 1)
            found.append(Harmonics(recording.name, f"cart_{cart + 1}", f, tuple(float(a) for a in amplitude)))
    return found
