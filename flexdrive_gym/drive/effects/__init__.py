"""The catalogue of physics: one file per effect, found by itself, chained into the step by site.

To add an effect, add a module here with an ``EFFECT``. Its parameters get a place in the parameter vector and its
hooks a place in the chains; simulator, environment, identification and diagnosis all have it from then on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects._effect import SITES, Effect, Parameter, Site, Where

__all__ = ["EFFECTS", "LAYOUT", "SITES", "Effect", "Parameter", "Slot", "Where", "chain"]

# the parameter vector starts with the inverse masses 1/m1 and 1/m2; 1/m2 = 0 makes a rigid, one-cart drive
MASSES = 2


@dataclass(frozen=True)
class Slot:
    """Where one parameter of one effect at one place lives in the parameter vector."""

    effect: Effect
    where: Where
    parameter: Parameter
    index: int
    base_index: int
    state_index: int

    @property
    def key(self) -> str:
        """Name of the parameter in a drive."""
        return self.effect.key(self.where, self.parameter.name)


def _discover() -> tuple[Effect, ...]:
    names = sorted(m.name for m in iter_modules(__path__) if not m.name.startswith("_"))
    found = [import_module(f"{__name__}.{name}").EFFECT for name in names]
    # base effects first, so that the fast variant of the step reads one short stretch of memory
    return tuple(sorted(found, key=lambda e: (not e.base, e.order, e.id)))


EFFECTS: tuple[Effect, ...] = _discover()


def _layout() -> dict[str, Slot]:
    slots: dict[str, Slot] = {}
    index, state = MASSES, 0
    for item in EFFECTS:
        for where in item.where:
            base = index
            for parameter in item.parameters:
                slot = Slot(item, where, parameter, index, base, state)
                slots[slot.key] = slot
                index += 1
            state += len(item.states)
    return slots


LAYOUT: dict[str, Slot] = _layout()
N_PARAMETERS = MASSES + len(LAYOUT)
N_BASE_PARAMETERS = MASSES + sum(slot.effect.base for slot in LAYOUT.values())
# at least one, so that the work space of the full variant has rows
N_STATES = max(1, sum(len(item.states) * len(item.where) for item in EFFECTS))


_ARGUMENTS: dict[str, tuple[str, bool]] = {
    # signature after the accumulated value, and whether the hook sees the additional states
    "command": ("t", False),
    "spring": ("delta, rate", True),
    "cart": ("x, v, fs, t", True),
    "friction": ("x, v, s, fs, t", False),
    "breakaway": ("x, s, fs, t", False),
    "rates": ("x1, v1, x2, v2, u, t", True),
    "reading": ("t", False),
}


def chain(site: Site, where: str | None = None, *, base: bool) -> Callable[..., Any]:
    """Compose the hooks of one site into one compiled function ``(acc, *arguments, z, r, p) -> acc``.

    Parameters
    ----------
    site
        A key of :data:`SITES`.
    where
        For sites that exist per place, the place; a hook named ``"cart:cart_2"`` belongs to one place whatever the
        effect's own ``where`` is.
    base
        Whether to compose only the effects that every drive has.
    """
    arguments, with_states = _ARGUMENTS[site]
    names: dict[str, Any] = {}
    lines: list[str] = []
    for item in EFFECTS:
        if base and not item.base:
            continue
        for place in item.where:
            slot = next(s for s in LAYOUT.values() if s.effect is item and s.where == place)
            own = item.hooks.get(site) if where is None or place == where else None
            targeted = item.hooks.get(f"{site}:{where}")  # type: ignore[call-overload]
            for hook in (own, targeted):
                if hook is None:
                    continue
                name = f"{item.id}_{len(names)}"
                names[name] = inlined(hook)
                state = f"z, r + {slot.state_index}, " if with_states else ""
                lines.append(f"    acc = {name}(acc, {arguments}, {state}p, {slot.base_index})")
    source = f"def composed(acc, {arguments}, z, r, p):\n" + "\n".join(lines) + "\n    return acc\n"
    # The hooks are known only once all files are found, and a compiled call must be written out; hence source text.
    exec(compile(source, f"<{site} chain>", "exec"), names)  # noqa: S102
    return inlined(names["composed"])
