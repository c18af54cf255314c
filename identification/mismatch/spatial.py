r"""Wavelengths along the track: what repeats with position shows as a line in the spatial spectrum of the missing force.

Encoders start anywhere, so the phase of a run says nothing about that of the next: powers are added, not amplitudes,

.. math:: S(P) = \sum_r \frac{|\sum_i g_{ri}\, e^{-2\pi i x_{ri}/P}|^2}{n_r\, \overline{g_r^2}} .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexdrive_gym.recording import FloatArray
from identification.diagnosis.missing_force import MissingForce

SHORTEST, LONGEST, WAVELENGTHS = 2.0, 160.0, 300
_STEP = 4
# wavelengths that a way of 100 mm tells apart
COMB_MM = tuple(100.0 / k for k in range(1, 26))


def wavelengths() -> FloatArray:
    """Return the wavelengths that are looked at [mm], shape (WAVELENGTHS,)."""
    return np.geomspace(SHORTEST, LONGEST, WAVELENGTHS)


def spectra(forces: Sequence[MissingForce], cart: int) -> tuple[FloatArray, FloatArray]:
    """Return the spatial power of the missing force of a cart at every wavelength, and that of the force against its motion.

    The latter, both of shape (WAVELENGTHS,), is what a friction that changes along the track would show.
    """
    P = wavelengths()
    total = np.zeros((2, len(P)))
    for force in forces:
        use = force.usable[cart]
        x, g = force.x[cart][use][::_STEP], force.g[cart][use][::_STEP]
        if len(x) < 50:
            continue
        waves = np.exp(-2j * np.pi * x[None, :] / P[:, None])
        # a wavelength longer than the way says nothing
        known = float(np.ptp(x)) > 0.8 * P
        for i, felt in enumerate((g, -g * np.sign(force.v[cart][use][::_STEP]))):
            rest = felt - felt.mean()
            power = np.abs(waves @ rest) ** 2 / max(float(rest @ rest), 1e-300) / len(rest)
            total[i] += power * len(rest) * known
    return total[0], total[1]


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
    powers = [spectra(forces, cart) for cart in range(len(forces[0].g))]
    found = {"cogging.P": (*peaks(powers[0][0], 4), *COMB_MM)}
    if len(powers) == 2:
        found["encoder_eccentricity.P"] = peaks(powers[1][0], 4)
    for cart, (_force, against) in enumerate(powers):
        found[f"position_friction.cart_{cart + 1}.P"] = peaks(against, 3)
    return {key: values for key, values in found.items() if values}
