"""Where an episode starts: the options of a reset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexdrive_gym.checks import as_mapping, did_you_mean, is_number
from flexdrive_gym.task import Task

STATES = ("x1", "v1", "x2", "v2")


def start_state(task: Task, options: Mapping[str, Any] | None, also: tuple[str, ...] = ()) -> tuple[float, ...]:
    """Return the state x1, v1, x2, v2 [mm, mm/s] from which the ``options`` of a reset start.

    Parameters
    ----------
    task
        Whose carts and limits count.
    options
        ``state`` with all four, or any of ``x1``, ``v1``, ``x2``, ``v2``; those that are not given are 0.
    also
        Names of options that mean something else and are left alone.

    Raises
    ------
    ValueError, TypeError
        For an unknown option, a value that is no finite number, or a start beyond a limit at which an episode ends.
    """
    if not options:
        return 0.0, 0.0, 0.0, 0.0
    given = as_mapping("options", options, "{'x1': 10.0}")
    carts = STATES if task.rig.carts == 2 else STATES[:2]
    known = ("state", *carts, *also)
    for name in given:
        if name not in known:
            raise ValueError(f"options: must be among {', '.join(known)}; got {name!r}.{did_you_mean(name, known)}")
    if "state" in given and any(name in given for name in carts):
        raise ValueError(f"options: give the whole state or single {', '.join(carts)}, not both; got {given!r}.")
    if "state" in given:
        whole = given["state"]
        if np.shape(whole) != (4,) or not all(map(is_number, whole)):
            raise ValueError(
                f"options: state must be four finite numbers x1, v1, x2, v2 [mm, mm/s]; got {whole!r}. Or give some by name: "
                "{'x1': 10.0}."
            )
        values = dict(zip(STATES, map(float, whole), strict=True))
    else:
        for name in carts:
            if not is_number(given.get(name, 0.0)):
                raise ValueError(f"options: {name} must be one finite number [mm, mm/s]; got {given[name]!r}.")
        values = {name: float(given.get(name, 0.0)) for name in STATES}
    _check_start(task, values)
    return tuple(values.values())


def _check_start(task: Task, at: Mapping[str, float]) -> None:
    two = task.rig.carts == 2
    for name in ("x1", "x2") if two else ("x1",):
        if abs(at[name]) > task.travel_limit:
            raise ValueError(
                f"options: {name} must be within the travel of ±{task.travel_limit:g} mm, beyond which an episode ends; got "
                f"{at[name]:g}."
            )
    if two and abs(at["x1"] - at["x2"]) > task.stroke_limit:
        raise ValueError(
            f"options: x1 - x2 must be within the spring's stroke of ±{task.stroke_limit:g} mm, beyond which an episode ends; "
            f"got {at['x1'] - at['x2']:g}. Give x1 and x2."
        )
