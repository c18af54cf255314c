r"""Wavelengths along the track: what repeats with position shows as a line in the spatial spectrum of the missing force.

Encoders start anywhere, so the phase of a run says nothing about that of the next: powers are added, not amplitudes,

.. math:: S(P) = \sum_r \frac{|\sum_i g_{ri}\, e^{-2\pi i x_{ri}/P}|^2}{n_r\, \overline{g_r^2}} .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.mismatch.missing_force import MissingForce

SHORTEST, LONGEST, WAVELENGTHS = 2.0, 160.0, 300
_STEP = 4
# wavelengths that a way of 100 mm tells apart
COMB_MM = tuple(100.0 / k for k in range(1, 26))


def wavelengths() -> FloatArray:
    """Return the wavelengths that are looked at [mm], shape (WAVELENGTHS,)."""
    return np.geomspace(SHORTEST, LONGEST, WAVELENGTHS)


def spectrum(forces: Sequence[MissingForce], cart: int, *, along_friction: bool = False) -> FloatArray:
    """Return the spatial power of the missing force of a cart at every wavelength, shape (WAVELENGTHS,).

    Parameters
    ----------
    along_friction
        Take the force against the direction of motion, as a friction that changes along the track would show.
    """
    P = wavelengths()
    total = np.zeros(len(P))
    for force in forces:
        use = force.usable[cart]
        x, g = force.x[cart][use][::_STEP], force.g[cart][use][::_STEP]
        if along_friction:
            g = -g * np.sign(force.v[cart][use][::_STEP])
        if len(x) < 50:
            continue
        g = g - g.mean()
        power = np.abs(np.exp(-2j * np.pi * x[None, :] / P[:, None]) @ g) ** 2 / max(float(g @ g), 1e-300) / len(g)
        # a wavelength longer than the way says nothing
        total += power * len(g) * (float(np.ptp(x)) > 0.8 * P)
    return total


def peaks(power: FloatArray, most: int) -> tuple[float, ...]:
    """Return the wavelengths [mm] at the highest local maxima, highest first."""
    P = wavelengths()
    inner = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (power[1:-1] > 0.0)
    place = np.flatnonzero(inner) + 1
    best = place[np.argsort(-power[place])][:most]
    return tuple(float(P[i]) for i in best)


def periods(forces: Sequence[MissingForce]) -> dict[str, tuple[float, ...]]:
    """Return start values for every period of the catalogue [mm]: those found in the data, and a comb of others for cogging.

    A rough track has a highest peak somewhere, too. The comb is for the null draws, which have their peaks elsewhere: looked at
    only where the recordings have theirs, they would show less than chance reaches by choosing its own place.
    """
    found = {"cogging.P": (*peaks(spectrum(forces, 0), 4), *COMB_MM)}
    carts = len(forces[0].g)
    if carts == 2:
        found["encoder_eccentricity.P"] = peaks(spectrum(forces, 1), 4)
    for cart in range(carts):
        found[f"position_friction.cart_{cart + 1}.P"] = peaks(spectrum(forces, cart, along_friction=True), 3)
    return {key: values for key, values in found.items() if values}
