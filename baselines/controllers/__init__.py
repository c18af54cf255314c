"""Controllers designed for any drive: one file per family, found by itself.

A controller is anything with ``reset()`` and ``controller(observation) -> command``
(:class:`flexdrive_gym.Controller`). The families here are linear: a :class:`Design` holds a
:class:`~flexdrive_gym.LinearController`, which follows that protocol, runs in the compiled loop, and has margins. To add one, add
a module with ``FAMILIES``.
"""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches
from importlib import import_module
from math import inf
from pkgutil import iter_modules

from baselines.controllers._design import LAB_4, SAMPLE_TIME_S, Design, Family, Specification
from baselines.controllers._effective import effective, rescaled
from flexdrive_gym import Drive

__all__ = ["FAMILIES", "KINDS", "LAB_4", "SAMPLE_TIME_S", "Design", "Family", "Specification", "design", "effective"]

_ORDER = ("p_control", "loop_shaping", "pd", "input_shaping", "cascade", "friction_compensation", "lqg", "h_infinity")


def _discover() -> tuple[dict[str, Family], dict[str, str]]:
    modules = [m.name for m in iter_modules(__path__) if not m.name.startswith("_")]
    modules.sort(key=lambda name: (_ORDER.index(name) if name in _ORDER else len(_ORDER), name))
    found = [(f, name) for name in modules for f in getattr(import_module(f"{__name__}.{name}"), "FAMILIES", ())]
    return {family.name: family for family, _module in found}, {family.name: module for family, module in found}


FAMILIES: dict[str, Family]
# family to its kind, which is the module it is in
KINDS: dict[str, str]
FAMILIES, KINDS = _discover()


def design(name: str, drive: Drive, *, sample_time: float = SAMPLE_TIME_S, limit: float = inf) -> Design:
    """Design a controller for a drive.

    Parameters
    ----------
    name
        Key of :data:`FAMILIES`.
    drive
        The identified drive; a design reads its linear part, the effects that act like a delay, a mass or a scale, and the
        friction levels where they are compensated.
    sample_time
        Control period [s].
    limit
        Of the command [V]; never more than the drive's own.

    Raises
    ------
    ValueError
        For an unknown name, or a drive the family cannot control.
    """
    if name not in FAMILIES:
        near = get_close_matches(name, FAMILIES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"controllers: must be among {', '.join(FAMILIES)}; got {name!r}.{hint}")
    made = FAMILIES[name].made(drive, sample_time)
    controller = rescaled(made.controller, drive)
    return replace(made, controller=controller.replace(limit=min(limit, drive.voltage_limit)))
