"""Names of the numbers the rig's kernel reads, and their null values."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_CART = {
    "m": 0.0,  # mass [V s²/mm]
    "b": 0.0,  # viscous friction [V s/mm]
    "d": 0.0,  # Coulomb level [V]
    "hump": 0.0,  # Lorentzian Stribeck hump over the Coulomb level [-]
    "vs": 10.0,  # its half-width [mm/s]
    "static": 0.0,  # static over kinetic level, at rest only [-]
    "bristle": 0.0,  # LuGre bristle stiffness [V/mm]; 0: rigid contact
    "d_skew": 0.0,  # level (1 ± d_skew) in the two directions [-]
    "b_skew": 0.0,  # viscous friction (1 ± b_skew), blended over a few mm/s [-]
    "drag": 0.0,  # drag·v·sqrt(v² + 15²) [V s²/mm²]
    "load": 0.0,  # friction per spring force [-]
    "cube": 0.0,  # brake cube·v³, outside the catalogue [V s³/mm³]
    "young": 0.0,  # extra level after a reversal [-], outside the catalogue
    "age": 0.2,  # its decay time [s]
    "scale": 0.0,  # encoder reads (1 + scale)·x [-]
    "late": 0.0,  # encoder delay [s]
    "play": 0.0,  # encoder reading lags by ±play [mm]
    "wobble": 0.0,  # eccentric wheel: amplitude of the reading's ripple [mm]
    "wheel": 60.0,  # its circumference [mm]
    "turn": 0.0,  # its phase [rad]
}

_DRIVE = {
    "k": 0.1,  # spring [V/mm]
    "bend": 0.0,  # 1/width of sinh (>0) or tanh (<0) hardening [1/mm]
    "k_skew": 0.0,  # stiffness (1 ± k_skew) pulled or pushed [-]
    "k_soft": 4.0,  # blending width of that [mm]
    "gap": 0.0,  # coupling free for abs(δ) < gap [mm]
    "bind_at": 1e9,  # coils touch beyond this δ [mm]
    "bind_k": 0.0,  # stiffness of touching coils, a Hertz-like contact [V/mm^1.5]
    "damper": 0.0,  # spring damping, a Maxwell element of 1 ms [V s/mm]
    "slip_k": 0.0,  # Iwan stack: stiffness [V/mm]
    "slip_at": 1.0,  # and the deflection at which its last element slips [mm]
    "offset": 0.0,  # added to the command [V]
    "notch": 0.0,  # dead zone of the command [V]
    "ceiling": 1e9,  # soft ceiling of the command [V]
    "sharp": 6.0,  # its sharpness [-]
    "wait": 0.0,  # delay of the command [s]
    "lag": 0.0,  # amplifier time constant [s]
    "gain_skew": 0.0,  # gain (1 ± gain_skew) [-]
    "slew": 1e9,  # slew limit [V/s], outside the catalogue
    "rotor": 0.0,  # share of m1 that is the motor, behind a gap or a belt [-]
    "lash": 0.0,  # half gap between motor and cart 1 [mm]
    "belt": 0.0,  # belt slips beyond this force [V], outside the catalogue; 0: gears
    "tail_m": 0.0,  # appendage: mass [V s²/mm]
    "tail_k": 0.0,  # stiffness [V/mm]
    "tail_b": 0.0,  # damping [V s/mm]
    "tail_on": 2.0,  # the cart it hangs on
    "push_friction": 0.0,  # level of cart 1 per volt of command [-], outside the catalogue
    "mutual": 0.0,  # force on a cart per acceleration of the other [V s²/mm], outside the catalogue
}

NULLS: Mapping[str, float] = MappingProxyType(
    {f"{name}{cart}": null for cart in (1, 2) for name, null in _CART.items()} | _DRIVE
)
INDEX: Mapping[str, int] = MappingProxyType({name: i for i, name in enumerate(NULLS)})
CART = len(_CART)
OFFSET: Mapping[str, int] = MappingProxyType({name: i for i, name in enumerate(_CART)})


def vector(values: Mapping[str, float]) -> FloatArray:
    """Return the kernel's vector.

    Raises
    ------
    KeyError
        For a name the rig does not know.
    """
    p = np.array(list(NULLS.values()))
    for name, value in values.items():
        if name not in INDEX:
            raise KeyError(f"values: the blind rig has no number called {name!r}; it knows {', '.join(NULLS)}.")
        p[INDEX[name]] = value
    return p
