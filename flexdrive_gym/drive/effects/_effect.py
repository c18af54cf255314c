"""What an effect is: a leaf of equation, parameters and hooks into the one step.

An effect is physics that can be present or absent. It has a **null value at which it is exactly the identity**, so
a drive is the two masses plus *all* effects, most of them at null, and naming physics means finding which
parameters are not null.

Hooks are plain functions on scalars; :mod:`flexdrive_gym.drive.effects` chains the hooks of one site over all
effects and compiles the chain into the step. Every hook receives what the chain has accumulated so far as its first
argument and returns it changed, or unchanged at null. The last two arguments are the drive's parameter vector ``p``
and the offset ``o`` of this effect's first parameter in it.

================ ================================================ ===================================================
site             signature                                        accumulates
================ ================================================ ===================================================
``command``      ``(u, t, p, o)``                                 the command on its way to the amplifier [V]
``actuator``     ``(u, dt, z, oz, p, o)``                         what the amplifier makes of it, of its own state [V]
``transmission`` ``(u, v1, z, oz, p, o)``                         what of that arrives at cart 1 [V]
``deflection``   ``(delta, p, o)``                                the deflection that the spring feels [mm]
``spring``       ``(f, delta, rate, z, oz, p, o)``                force the spring puts on cart 2, minus it on cart 1 [V]
``damping``      ``(b, v, s, t, p, o)``                           viscous coefficient of the cart; its force is -b·v
``cart``         ``(f, x, v, s, dx, t, z, oz, p, o)``             smooth force on the cart besides all of these [V]
``friction``     ``(d, x, v, s, fs, t, p, o)``                    kinetic Coulomb level while sliding in direction s [V]
``breakaway``    ``(d, x, s, fs, t, p, o)``                       level to overcome from rest in direction s [V]
``track``        ``(a, f, m, z, oz, p, o)``                       acceleration of the track itself [mm/s²]
``rates``        ``(w, x1, v1, x2, v2, u, a, t, z, oz, p, o)``    writes its states' rates to ``z[oz + w], ...``
``begin``        ``(w, v, v1, v2, u, z, oz, p, o)``               writes its states or memory at the start; returns w
``finish``       ``(w, dx, s, u, dt, z, oz, p, o)``               brings its memory to the end of a piece; returns w
``reading``      ``(y, x, v, t, h, z, oz, p, o)``                 what the encoder of that cart reports [mm]
``speed``        ``(r, p, o)``                                    rate of the readings before any filter [mm/s]
================ ================================================ ===================================================

``x, v`` are the cart's position [mm] and velocity [mm/s]; ``x`` includes the anchor of a replay (where the rig really was, see
:func:`~flexdrive_gym.drive.kernels.run_open_loop`). ``s`` is the direction of sliding, 0 at rest. ``fs`` is the spring force [V],
``t`` the time since the start of the run [s], ``h`` the sample time [s]. ``dx`` and ``dt`` are the way and the time since the
beginning of the smooth piece that is being integrated; the direction of sliding and the command are constant in a piece.
``f`` is the force on the sliding carts [V], friction included, ``m`` the mass of those that stick [V s²/mm], ``a`` what the
chain of ``track`` made of them: the carts' positions are relative to the track.

What an effect remembers comes in two kinds, and ``z[oz]`` is the first of its own:

* ``states`` are integrated: ``rates`` gives their rates, and every stage of the integrator has its row of them;
* ``memory`` cells are constant within a piece or between samples: a law that is known in closed form over a piece (a bristle
  along the way, a lag under a held command) is evaluated exactly from ``dx`` or ``dt`` and written down by ``finish``;
  sensors write theirs in ``reading``, whose first call has ``t = 0``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

Where = Literal[
    "cart_1",
    "cart_2",
    "spring",
    "actuator",
    "drivetrain",
    "guide",
    "encoder_1",
    "encoder_2",
    "structure",
    "parameters",
]
# samples that are remembered for delays; three of them are needed to interpolate and to hold
RING = 64

Site = Literal[
    "command",
    "actuator",
    "transmission",
    "deflection",
    "spring",
    "damping",
    "cart",
    "friction",
    "breakaway",
    "track",
    "rates",
    "begin",
    "finish",
    "reading",
    "speed",
]
SITES: tuple[Site, ...] = get_args(Site)
Hook = Callable[..., Any]


@dataclass(frozen=True)
class Parameter:
    """One named, bounded number of the drive.

    Attributes
    ----------
    name
        Symbol of the handout or of the effect's reference.
    unit
        In the handout's V-scaled units: V s²/mm, V s/mm, V/mm, V, mm, s, Hz.
    null
        Value at which the effect is exactly absent.
    lower, upper
        Bounds within which the value makes sense.
    meaning
        A few words.
    starts
        Values from which a fit starts, at plainly present size.
    role
        ``size``: the effect grows with it from nothing at null, in first proportion, so a sensitivity at null means something.
        ``shape``: how the effect looks (a width, a period); without its size it does nothing, its ``null`` is only the
        value it has where none is given, and a fit needs the grid of ``starts``.
    extended
        In a base effect: a drive that has this parameter off its null needs the variant with all effects.
    finer
        A detail of the law, absent at null and nothing by itself: a diagnosis fits it once the effect leads.
    """

    name: str
    unit: str
    null: float
    lower: float
    upper: float
    meaning: str
    starts: tuple[float, ...] = ()
    role: Literal["size", "shape"] = "size"
    extended: bool = False
    finer: bool = False


@dataclass(frozen=True)
class Effect:
    """A leaf: what the physics is, its parameters, and its hooks.

    Attributes
    ----------
    id
        Name in the catalogue; what the tool prints and writes.
    where
        Places that can carry it; each place is an instance with its own parameters.
    equation
        In the handout's symbols.
    parameters
        In the order in which the hooks see them, ``p[o]`` first.
    hooks
        Site to plain function.
    tells_itself_by, looks_like, separating_experiment, reference
        For the diagnosis and the documentation.
    states
        Names of additional states that are integrated.
    memory
        How many memory cells it keeps per place; an effect has states or memory, not both.
    fastest_rate
        Largest rate [1/s] the effect brings for its parameter values and the masses of both carts [V s²/mm], so that the step
        can be refined.
    base
        Part of every drive, compiled into the fast variant of the step.
    order
        Place in the chain of its site, small first (a command is limited before it is delayed).
    symbols
        For a base effect: the handout's symbol of each parameter per place, for example ``{"cart_1": ("b1",)}``.
    """

    id: str
    where: tuple[Where, ...]
    equation: str
    parameters: tuple[Parameter, ...]
    hooks: Mapping[Site, Hook] = field(default_factory=dict)
    tells_itself_by: str = ""
    looks_like: tuple[str, ...] = ()
    separating_experiment: str = ""
    reference: str = ""
    states: tuple[str, ...] = ()
    memory: int = 0
    fastest_rate: Callable[[tuple[float, ...], tuple[float, float]], float] | None = None
    base: bool = False
    order: int = 0
    symbols: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def key(self, where: str, name: str) -> str:
        """Name of one parameter in a drive, for example ``b1`` or ``stribeck.cart_1.vs``."""
        names = tuple(parameter.name for parameter in self.parameters)
        if where in self.symbols:
            return self.symbols[where][names.index(name)]
        if len(self.where) == 1:
            return f"{self.id}.{name}"
        return f"{self.id}.{where}.{name}"
