"""The catalogue of physics: one file per effect, found by itself, chained into the step by site.

To add an effect, add a module here with an ``EFFECT``. Its parameters get a place in the parameter vector and its
hooks a place in the chains; simulator, environment, identification and diagnosis all have it from then on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np

from flexdrive_gym.drive.compilation import called, inlined
from flexdrive_gym.drive.effects._effect import RING, SITES, Effect, Parameter, Site, Where
from flexdrive_gym.drive.simd.pack import leading, raised

__all__ = ["EFFECTS", "LAYOUT", "RING", "SITES", "Effect", "Parameter", "Slot", "Where", "chain", "hooks_of"]

# the parameter vector starts with the inverse masses 1/m1 and 1/m2; 1/m2 = 0 makes a rigid, one-cart drive
MASSES = 2
# rows of additional states: state, stage, four slopes, trial
ROWS = 7


@dataclass(frozen=True)
class Slot:
    """Where one parameter of one effect at one place lives in the parameter vector, and what it remembers."""

    effect: Effect
    where: Where
    parameter: Parameter
    index: int
    base_index: int
    state_index: int
    memory_index: int

    @property
    def key(self) -> str:
        """Name of the parameter in a drive."""
        return self.effect.key(self.where, self.parameter.name)

    @property
    def switches(self) -> bool:
        """Whether this parameter off its null makes the variant with all effects necessary."""
        return self.parameter.extended or (not self.effect.base and self.parameter.role == "size")


def _discover() -> tuple[Effect, ...]:
    names = sorted(m.name for m in iter_modules(__path__) if not m.name.startswith("_"))
    found = [import_module(f"{__name__}.{name}").EFFECT for name in names]
    # base effects first, so that the fast variant of the step reads one short stretch of memory
    return tuple(sorted(found, key=lambda e: (not e.base, e.order, e.id)))


EFFECTS: tuple[Effect, ...] = _discover()


def _layout() -> dict[str, Slot]:
    slots: dict[str, Slot] = {}
    index, state, memory = MASSES, 0, 0
    for item in EFFECTS:
        for where in item.where:
            base = index
            for parameter in item.parameters:
                slot = Slot(item, where, parameter, index, base, state, memory)
                slots[slot.key] = slot
                index += 1
            state += len(item.states)
            memory += item.memory
    return slots


LAYOUT: dict[str, Slot] = _layout()
N_PARAMETERS = MASSES + len(LAYOUT)
N_BASE_PARAMETERS = MASSES + sum(slot.effect.base for slot in LAYOUT.values())
N_STATES = sum(len(item.states) * len(item.where) for item in EFFECTS)
N_MEMORY = sum(item.memory * len(item.where) for item in EFFECTS)

# The workspace of the variant with all effects: rows of states; where a replay anchors the carts; where and when the piece
# began; additional forces on the carts; Coulomb levels that a run has besides the drive's; the acceleration of the track that
# goes with the accelerations found last; which chains have anything to do;
# whether none of those has between events, and whether none has but those of forces on the carts; which hooks have anything to
# do; memory.
ANCHOR_1, ANCHOR_2, BEGIN_1, BEGIN_2, BEGIN_T, PUSH_1, PUSH_2, LEVEL_1, LEVEL_2, RECOIL = (
    ROWS * N_STATES + i for i in range(10)
)
_FLAGS = ROWS * N_STATES + 10

ARGUMENTS: dict[str, str] = {
    # signature after the accumulated value
    "command": "t",
    "actuator": "dt",
    "transmission": "v1",
    "deflection": "",
    "spring": "delta, rate",
    "damping": "v, s, t",
    "cart": "x, v, s, dx, t",
    "friction": "x, v, s, fs, t",
    "breakaway": "x, s, fs, t",
    "track": "f, m",
    "rates": "x1, v1, x2, v2, u, a, t",
    "begin": "v, v1, v2, u",
    "finish": "dx, s, u, dt",
    "reading": "x, v, t, h",
    "speed": "",
}
# sites whose hooks see what the effect remembers
REMEMBERING = {"actuator", "transmission", "spring", "cart", "track", "rates", "begin", "finish", "reading"}
# chains that exist once per place
_PLACES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("damping", "cart", "friction", "breakaway"), ("cart_1", "cart_2")),
    **dict.fromkeys(("reading", "speed"), ("encoder_1", "encoder_2")),
    "begin": ("cart_1", "cart_2", "actuator", "drivetrain", "structure"),
    "finish": ("cart_1", "cart_2", "actuator"),
}
CHAINS: tuple[tuple[str, str | None], ...] = tuple((site, w) for site in SITES for w in _PLACES.get(site, (None,)))
FLAG = {which: _FLAGS + i for i, which in enumerate(CHAINS)}
LINEAR = _FLAGS + len(CHAINS)
ON_CARTS = LINEAR + 1
_HOOK_FLAGS = ON_CARTS + 1


def hooks_of(site: str, where: str | None) -> list[tuple[Callable[..., Any], Slot]]:
    """Return hooks of one chain in order, each with the slot of its effect's first parameter at its place."""
    found = []
    for item in sorted(EFFECTS, key=lambda e: e.order):
        for place in item.where:
            slot = next(s for s in LAYOUT.values() if s.effect is item and s.where == place)
            own = item.hooks.get(site) if where is None or place == where else None  # type: ignore[call-overload]
            targeted = item.hooks.get(f"{site}:{where}")  # type: ignore[call-overload]
            found += [(hook, slot) for hook in (own, targeted) if hook is not None]
    return found


# whether a hook of an effect beyond the base has anything to do
_HOOK_FLAG = {
    (*which, slot.effect.id, slot.where): i
    for i, (which, slot) in enumerate(
        ((which, slot) for which in CHAINS for _hook, slot in hooks_of(*which) if not slot.effect.base),
        start=_HOOK_FLAGS,
    )
}
_MEMORY = _HOOK_FLAGS + len(_HOOK_FLAG)
WORKSPACE = _MEMORY + N_MEMORY
# what a step reads and writes of a workspace, besides flags: the state, the places and forces of a replay, what effects
# remember that are no encoder's
SEEN_BY_STEP = np.array(
    [
        *range(N_STATES),
        *range(ROWS * N_STATES, _FLAGS),
        *sorted(
            {
                _MEMORY + slot.memory_index + i
                for slot in LAYOUT.values()
                if "reading" not in slot.effect.hooks
                for i in range(slot.effect.memory)
            }
        ),
    ],
    dtype=np.int64,
)


# of a hook that is in several chains the compiler makes one function
_compiled = cache(inlined)


def _lines(site: str, where: str | None, names: dict[str, Any], *, base: bool) -> list[str]:
    lines = []
    for hook, slot in hooks_of(site, where):
        if base and not slot.effect.base:
            continue
        name = f"{slot.effect.id}_{len(names)}"
        names[name] = _compiled(hook)
        own = f"r + {slot.state_index}" if slot.effect.states else f"{_MEMORY + slot.memory_index}"
        arguments = ["acc", ARGUMENTS[site], f"z, {own}" if site in REMEMBERING else "", f"p, {slot.base_index}"]
        flag = None if slot.effect.base else _HOOK_FLAG[site, where, slot.effect.id, slot.where]
        condition = "" if flag is None else f"if raised(z, {flag}): "
        lines.append(f"{condition}acc = {name}({', '.join(a for a in arguments if a)})")
    return lines


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
        Whether to compose only the effects that every drive has. The chain with all of them has a flag in the workspace and
        skips them where it is not set.
    """
    names: dict[str, Any] = {"raised": raised}
    lines = _lines(site, where, names, base=True)
    if not base:
        skip = [f"    {line}" for line in [*lines, "return acc"]]
        lines = [f"if not raised(z, {FLAG[site, where]}):", *skip, *_lines(site, where, names, base=False)]
    arguments = ", ".join(a for a in ("acc", ARGUMENTS[site], "z, r, p") if a)
    source = "\n    ".join([f"def composed({arguments}):", *lines, "return acc\n"])
    # The hooks are known only once all files are found, and a compiled call must be written out; hence source text.
    exec(compile(source, f"<{site} chain>", "exec"), names)  # noqa: S102
    # which chain it is, for whoever translates the step into another language
    names["composed"].chain = (site, where)
    return inlined(names["composed"])


def _switches() -> list[tuple[int, float, int]]:
    """Return parameter, its null, and the flag it sets, for every chain, hook and parameter that makes them necessary."""
    found = []
    for which in CHAINS:
        for effect, place in dict.fromkeys((s.effect.id, s.where) for _hook, s in hooks_of(*which)):
            flags = [FLAG[which]]
            if (*which, effect, place) in _HOOK_FLAG:
                flags.append(_HOOK_FLAG[*which, effect, place])
            for other in LAYOUT.values():
                if (other.effect.id, other.where) == (effect, place) and other.switches:
                    found += [(other.index, other.parameter.null, flag) for flag in flags]
    return found


_SWITCHES = _switches()
_SWITCH_PARAMETER = np.array([s[0] for s in _SWITCHES], dtype=np.int64)
_SWITCH_NULL = np.array([s[1] for s in _SWITCHES])
_SWITCH_FLAG = np.array([s[2] for s in _SWITCHES], dtype=np.int64)


# chains that act at events, at the beginning of a run or outside the mechanics leave a sliding drive as linear as it is
_APART = {"command", "breakaway", "begin", "reading", "speed"}
_CART = (("cart", "cart_1"), ("cart", "cart_2"), ("finish", "cart_1"), ("finish", "cart_2"))
_OF_CARTS = np.array([FLAG[which] for which in _CART], dtype=np.int64)
_ELSEWHERE = np.array([i for which, i in FLAG.items() if which[0] not in _APART and which not in _CART], dtype=np.int64)


@called
def prepare(z: Any, p: Any) -> None:
    """Clear a workspace and note which chains and hooks have anything to do for these parameters."""
    for i in range(WORKSPACE):
        z[i] = 0.0
    for i in range(len(_SWITCH_PARAMETER)):
        if p[_SWITCH_PARAMETER[i]] != _SWITCH_NULL[i]:
            z[_SWITCH_FLAG[i]] = 1.0
    of_carts, elsewhere = 0.0, 0.0
    for i in range(len(_OF_CARTS)):
        of_carts += leading(z[_OF_CARTS[i]])
    for i in range(len(_ELSEWHERE)):
        elsewhere += leading(z[_ELSEWHERE[i]])
    z[LINEAR] = 1.0 if of_carts + elsewhere == 0.0 else 0.0
    z[ON_CARTS] = 1.0 if elsewhere == 0.0 else 0.0
