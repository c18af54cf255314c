"""What one visitor has chosen, and the address that holds it.

A setting that is ``None`` is the drive's own. Everything is in the engine's units (V, mm, s); pages convert.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from math import isfinite
from typing import Any, Literal, get_args
from urllib.parse import urlencode

from flexdrive_gym.drive.effects import LAYOUT

Feedback = Literal["x1", "x2"]
Reference = Literal["moves", "one_move", "step", "rest"]

SMALLEST_GAIN, LARGEST_GAIN = 0.005, 10.0
SMALLEST_FACTOR, LARGEST_FACTOR = 0.05, 20.0
SAMPLE_TIMES_S = (1e-3, 2e-3, 5e-3, 10e-3, 20e-3)
LARGEST_LIMIT_V = 24.0
LARGEST_DELAY_S = 0.03
LARGEST_COUNT_MM = 1.0
LARGEST_PUSH_MM_S = 1000.0
MOST_PUSHES = 8
DURATION_S = 8.0


@dataclass(frozen=True)
class Push:
    """A blow that changes a cart's velocity at once.

    Attributes
    ----------
    cart
        1 or 2.
    time
        [s]
    speed
        Change of velocity [mm/s].
    """

    cart: int
    time: float
    speed: float


@dataclass(frozen=True)
class Settings:
    """One visitor's choice.

    Attributes
    ----------
    drive, beside
        Keys of the drives shown; ``beside`` empty: one alone.
    controller
        ``p``, a family of :mod:`baselines.controllers`, ``agent:NAME``, ``own``, or ``square`` and ``sine`` in open loop.
    feedback
        Encoder that P-control reads.
    gain
        Kp of P-control [V/mm].
    factor
        On the command of every other controller [].
    reference
        What is followed: the handout's trajectory, its first move, a step, or standing still.
    amplitude, frequency
        Of an open-loop command [V], [Hz].
    limit, delay, count
        Command limit [V], input delay [s] and encoder count [mm]; ``None``: the drive's own.
    sample_time
        Control period [s].
    effects
        Parameter name to value, for what is switched on besides the drive's own.
    pushes
        Blows on the carts.
    """

    drive: str = ""
    beside: str = ""
    controller: str = "p"
    feedback: Feedback = "x2"
    gain: float = 0.05
    factor: float = 1.0
    reference: Reference = "moves"
    amplitude: float = 2.0
    frequency: float = 0.5
    limit: float | None = None
    delay: float | None = None
    count: float | None = None
    sample_time: float = 1e-3
    effects: Mapping[str, float] = field(default_factory=dict)
    pushes: tuple[Push, ...] = ()

    def replace(self, **changes: Any) -> Settings:
        """Return other settings."""
        return replace(self, **changes)

    @property
    def open_loop(self) -> bool:
        """Whether a command is played and nothing fed back."""
        return self.controller in {"square", "sine"}

    def query(self) -> str:
        """Return the settings as the query of an address; what is as usual is left out."""
        usual, pairs = Settings(), []
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name in {"effects", "pushes"} or value == getattr(usual, f.name) or value is None:
                continue
            pairs.append((f.name, f"{value:.6g}" if isinstance(value, float) else value))
        pairs += [("effect", f"{name}:{value:.6g}") for name, value in self.effects.items()]
        pairs += [("push", f"{p.cart}:{p.time:.6g}:{p.speed:.6g}") for p in self.pushes]
        return urlencode(pairs)


def _number(low: float, high: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = float(text)
        if not (isfinite(value) and low <= value <= high):
            raise ValueError(f"must lie in [{low:g}, {high:g}]; got {value:g}")
        return value

    return read


def _among(*names: Any) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        for name in names:
            if (isinstance(name, float) and abs(float(text) - name) < 1e-9) or text == name:
                return name
        raise ValueError(f"must be among {', '.join(map(str, names))}; got {text[:40]!r}")

    return read


def _any_name(text: str) -> str:
    if len(text) > 80 or not text.isprintable():
        raise ValueError(f"must be a name of at most 80 characters; got {len(text)}")
    return text


_READ: dict[str, Callable[[str], Any]] = {
    "drive": _any_name,
    "beside": _any_name,
    "controller": _any_name,
    "feedback": _among(*get_args(Feedback)),
    "gain": _number(SMALLEST_GAIN, LARGEST_GAIN),
    "factor": _number(SMALLEST_FACTOR, LARGEST_FACTOR),
    "reference": _among(*get_args(Reference)),
    "amplitude": _number(0.0, LARGEST_LIMIT_V),
    "frequency": _number(0.05, 50.0),
    "limit": _number(0.1, LARGEST_LIMIT_V),
    "delay": _number(0.0, LARGEST_DELAY_S),
    "count": _number(0.0, LARGEST_COUNT_MM),
    "sample_time": _among(*SAMPLE_TIMES_S),
}


def effect_value(name: str, value: float) -> float:
    """Return a value of an effect's parameter if it may be set.

    Raises
    ------
    ValueError
        For an unknown parameter or a value out of its bounds.
    """
    slot = LAYOUT.get(name)
    if slot is None:
        raise ValueError(f"effect: no parameter is called {name[:60]!r}")
    low, high = slot.parameter.lower, slot.parameter.upper
    if not (isfinite(value) and low <= value <= high):
        raise ValueError(f"{name}: must lie in [{low:g}, {high:g}] {slot.parameter.unit}; got {value:g}")
    return value


def _push(text: str) -> Push:
    cart, time, speed = text.split(":")
    if cart not in {"1", "2"}:
        raise ValueError(f"push: cart must be 1 or 2; got {cart[:20]!r}")
    bound = LARGEST_PUSH_MM_S
    return Push(int(cart), _number(0.0, DURATION_S)(time), _number(-bound, bound)(speed))


def from_query(pairs: list[tuple[str, str]]) -> tuple[Settings, list[str]]:
    """Read the query of an address.

    Parameters
    ----------
    pairs
        Names and texts.

    Returns
    -------
    settings
        What could be read; the rest is as usual.
    refused
        One sentence for each that could not.
    """
    found: dict[str, Any] = {}
    effects: dict[str, float] = {}
    pushes: list[Push] = []
    refused = []
    for name, text in pairs[:200]:
        try:
            if name == "effect":
                key, value = text.rsplit(":", 1)
                effects[key] = effect_value(key, float(value))
            elif name == "push" and len(pushes) < MOST_PUSHES:
                pushes.append(_push(text))
            elif name in _READ:
                found[name] = _READ[name](text)
        except ValueError as error:
            refused.append(f"{name}: {error}" if not str(error).startswith(name) else str(error))
    return Settings(**found, effects=effects, pushes=tuple(pushes)), refused
