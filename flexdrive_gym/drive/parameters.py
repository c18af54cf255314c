"""Named, bounded parameters of a drive, and the vector the compiled step reads."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from math import ceil, inf, isnan

import numpy as np

from flexdrive_gym.drive.effects import EFFECTS, LAYOUT, N_PARAMETERS, RING, WORKSPACE, Parameter
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import LAB, Units

MASS_PARAMETERS: dict[str, Parameter] = {
    "m1": Parameter("m1", "V s²/mm", inf, 1e-9, 1e3, "mass of cart 1 with the motor"),
    "m2": Parameter("m2", "V s²/mm", inf, 1e-9, inf, "mass of cart 2"),
}

# a refined step keeps |rate·h| below this, well inside RK4's stability limit of 2.78
_STABLE = 1.0
# where a step would be divided more often, an effect is as good as instantaneous, and a simulation would hardly end
_MOST_STEPS = 10_000


def parameter(name: str) -> Parameter:
    """Return the specification of a parameter.

    Raises
    ------
    KeyError
        For an unknown name; the message has near matches.
    """
    if name in MASS_PARAMETERS:
        return MASS_PARAMETERS[name]
    if name in LAYOUT:
        return LAYOUT[name].parameter
    names = [*MASS_PARAMETERS, *LAYOUT]
    near = get_close_matches(name, names, n=3, cutoff=0.4)
    hint = f"did you mean {' or '.join(near)}?" if near else f"the names are {', '.join(names)}."
    raise KeyError(f"parameter: no parameter of the drive is called {name!r}; {hint}")


def checked(values: Mapping[str, float], units: Units = LAB) -> dict[str, float]:
    """Check names and bounds; return the values that are not null, in a fixed order.

    Parameters
    ----------
    units
        Of the rig. A bound on volts or millimetres is the lab's: of what another rig measures in units of its own only the sign
        is bounded.

    Raises
    ------
    KeyError
        For an unknown name.
    ValueError
        For a value out of bounds, naming parameter, rule and value.
    """
    result: dict[str, float] = {}
    for name, value in values.items():
        spec = parameter(name)
        number = float(value)
        low, high = spec.lower, spec.upper
        if units.name(spec.unit) != spec.unit or units.one(spec.unit) != 1.0:
            low, high = (0.0 if low >= 0.0 else -inf), inf
        if isnan(number) or not low <= number <= high or (number == 0.0 and spec.lower > 0.0 == low):
            raise ValueError(
                f"{name}: must lie in [{low:g}, {high:g}] {units.name(spec.unit)}; got {number:g}. "
                f"It is the {spec.meaning}; its absence is {spec.null:g}."
            )
        # an effect's shape is kept though it be the usual one: a drive in a file shall say which
        if number != spec.null or (spec.role == "shape" and not LAYOUT[name].effect.base):
            result[name] = number
    order = {name: i for i, name in enumerate([*MASS_PARAMETERS, *LAYOUT])}
    return dict(sorted(result.items(), key=lambda item: order[item[0]]))


_NULL = np.zeros(N_PARAMETERS)
for _slot in LAYOUT.values():
    _NULL[_slot.index] = _slot.parameter.null


_INDEX = {"m1": 0, "m2": 1} | {_name: _slot.index for _name, _slot in LAYOUT.items()}


def index(name: str) -> int:
    """Return the place of a parameter in the vector; masses are stored there as their inverse."""
    return _INDEX.get(name, -1)


def vector(values: Mapping[str, float]) -> FloatArray:
    """Return the parameter vector of the compiled step.

    Returns
    -------
    ndarray, shape (n_parameters,)
        1/m1, 1/m2 (0 for a rigid drive), then every effect's parameters.
    """
    p = _NULL.copy()
    for name, value in values.items():
        p[index(name)] = 1.0 / value if name in MASS_PARAMETERS else value
    return p


def workspace(values: Mapping[str, float]) -> FloatArray | None:
    """Return the step's workspace, or ``None`` if only effects every drive has are present."""
    return np.zeros(WORKSPACE) if needs_workspace(values) else None


def needs_workspace(values: Mapping[str, float]) -> bool:
    """Whether there are other effects than those that every drive has."""
    return any(name in LAYOUT and LAYOUT[name].switches for name in values)


# keys of every effect that may need a shorter step, at every place
_FAST = [
    (tuple(item.key(where, q.name) for q in item.parameters), item)
    for item in EFFECTS
    if item.fastest_rate is not None
    for where in item.where
]


def fastest(values: Mapping[str, float]) -> tuple[float, tuple[str, ...]]:
    """Return the fastest rate of any effect that is present [1/s], and the effect's keys; 0 if none needs a shorter step."""
    rate = 0.0
    which: tuple[str, ...] = ()
    masses = values.get("m1", inf), values.get("m2", inf)
    for keys, item in _FAST:
        if item.fastest_rate is not None and any(key in values and LAYOUT[key].switches for key in keys):
            own = item.fastest_rate(
                tuple(values.get(k, q.null) for k, q in zip(keys, item.parameters, strict=True)), masses
            )
            if own > rate:
                rate, which = own, keys
    return rate, which


def substeps(values: Mapping[str, float], sample_time: float, physics_step: float) -> int:
    """Return how many physics steps a sample takes: no longer than asked, short enough for the fastest effect.

    Raises
    ------
    ValueError
        If an effect is so fast that a simulation would hardly end, naming its parameters.
    """
    rate, which = fastest(values)
    h = min(physics_step, _STABLE / rate) if rate > 0.0 else physics_step
    whole = min(sample_time, physics_step)
    if h * _MOST_STEPS <= whole:
        given = ", ".join(f"{k} = {values[k]:.3g}" for k in which if k in values)
        raise ValueError(
            f"{given}: moves at {rate:.3g} 1/s, and at most {_MOST_STEPS} steps are taken instead of one of {whole:g} s. "
            "Choose values that make the effect slower, or leave it out."
        )
    return max(1, ceil(sample_time / h - 1e-9))


def check_delays(values: Mapping[str, float], sample_time: float) -> None:
    """Check that the delays of a drive are short enough to be held.

    Raises
    ------
    ValueError
        Naming the delay and how many samples are held.
    """
    for name in ("input_delay.tau", "encoder_delay.encoder_1.tau", "encoder_delay.encoder_2.tau"):
        delay = values.get(name, 0.0)
        if delay > (RING - 3) * sample_time:
            raise ValueError(
                f"{name}: at most {RING - 3} samples of {sample_time:g} s are held; got {delay:g} s. "
                "Use a longer sample time."
            )
