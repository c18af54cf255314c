"""Where things are in the exported step: the effects that a drive has, their parameters, states and memory cells."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from baselines.export.translation.function import NOTES
from flexdrive_gym.drive import forces
from flexdrive_gym.drive.effects import FLAG, LAYOUT, ROWS, Slot, hooks_of


def field_name(key: str) -> str:
    """Return a parameter's name as a field of MATLAB: ``stribeck.cart_1.vs`` becomes ``stribeck_cart_1_vs``."""
    return key.replace(".", "_")


class Placement:
    """The effects that a drive has, and where what belongs to them is.

    Parameters
    ----------
    present
        (effect id, place) of the effects beyond the base that the drive has.
    constants
        Factors on constants with a unit, by name.

    Attributes
    ----------
    states
        How many states all effects have.
    cells
        What each number is that the effects remember, counted from 1.
    looks_back
        Whether a hook asks how far a piece has come.
    """

    def __init__(self, present: Collection[tuple[str, str]], constants: Mapping[str, float]) -> None:
        self._present = set(present)
        self._constants = dict(constants)
        self._place()

    def _place(self) -> None:
        """Give the states and memory cells of the effects that are present their places, without gaps."""
        own: dict[tuple[str, str], Slot] = {}
        for slot in LAYOUT.values():
            own.setdefault((slot.effect.id, slot.where), slot)
        mine = [slot for which, slot in own.items() if which in self._present]
        self.states, self._state_at = 0, {}
        names = []
        for slot in mine:
            self._state_at[slot.effect.id, slot.where] = self.states
            self.states += len(slot.effect.states)
            names += [f"{slot.effect.id}, {slot.where}: {state}" for state in slot.effect.states]
        rows = ("state", "stage", "slope 1", "slope 2", "slope 3", "slope 4", "trial")
        self.cells = {i + 1: f"{names[i % self.states]} ({rows[i // self.states]})" for i in range(ROWS * self.states)}
        at = ROWS * self.states
        self._note_at = {name: at + i for i, name in enumerate(NOTES)}
        words = (
            "x1 where the piece began",
            "x2 where the piece began",
            "time when it began",
            "acceleration of the track",
        )
        self.cells |= {at + i + 1: text for i, text in enumerate(words)}
        at += len(NOTES)
        self._memory_at = {}
        for slot in mine:
            self._memory_at[slot.effect.id, slot.where] = at
            for i in range(slot.effect.memory):
                self.cells[at + i + 1] = f"{slot.effect.id}, {slot.where}: memory {i + 1}"
            at += slot.effect.memory
        sites = {site.partition(":")[0] for slot in mine for site in slot.effect.hooks}
        # only such hooks ask how far a piece has come
        self.looks_back = bool(sites & {"actuator", "cart", "finish"})

    def active(self, site: str, where: str | None) -> list[tuple[Callable[..., Any], Slot]]:
        """Return the hooks of a chain that this drive has."""
        return [
            (hook, slot)
            for hook, slot in hooks_of(site, where)
            if slot.effect.base or (slot.effect.id, slot.where) in self._present
        ]

    def own(self, slot: Slot) -> str:
        """Return where in the workspace an effect's own cells begin, as the source of a hook's call says it."""
        which = (slot.effect.id, slot.where)
        # base effects remember nothing
        return f"r + {self._state_at[which]}" if slot.effect.states else f"{self._memory_at.get(which, 0)}"

    def flagged(self, flag: int) -> bool:
        """Whether a flag of the workspace is set for this drive."""
        for which, index in FLAG.items():
            if index == flag:
                return any(not slot.effect.base for _hook, slot in self.active(*which)) or which == ("command", None)
        return False  # linear between events, or all effects on carts only: shortcuts that are not taken

    def parameter(self, index: int) -> str:
        """Return a parameter of the vector as an expression."""
        if index in (forces.W1, forces.W2):
            return f"(1 / p.{'m1' if index == forces.W1 else 'm2'})"
        return f"p.{field_name(next(key for key, slot in LAYOUT.items() if slot.index == index))}"

    def constant(self, module: str, name: str, value: float) -> float:
        """Return a constant of a module, in the units that the step runs in."""
        return value * self._constants.get(f"{module.rpartition('.')[2]}.{name}", 1.0)

    def note(self, name: str) -> int:
        """Return where in the workspace a note of the step is."""
        return self._note_at[name]
