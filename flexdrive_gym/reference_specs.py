"""What a user may call a reference, and how each form becomes one value per sample.

A reference is asked for by a name in a registry of :class:`ReferenceKind`, by a name with keywords, as an array or
as a function. Everything a user can get wrong is found here, before a run, in a sentence about ``reference``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from inspect import Parameter, signature
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flexdrive_gym.recording import FloatArray

ReferenceFunction: TypeAlias = Callable[..., npt.ArrayLike]
ReferenceSpec: TypeAlias = str | tuple[str, Mapping[str, float]] | npt.ArrayLike | ReferenceFunction

FORMS = (
    "a name, a text 'name:keyword=value:…', (name, {keyword: value}), an array of positions [mm] or a function of t [s]"
)


@dataclass(frozen=True)
class ReferenceParameter:
    """One keyword of a reference: its default, unit and meaning in a few words."""

    name: str
    default: float
    unit: str
    meaning: str


@dataclass(frozen=True)
class ReferenceKind:
    """One reference that has a name.

    Attributes
    ----------
    function
        Takes instants [s] and the keywords (and ``rng`` where random); returns positions [mm].
    meaning
        One line.
    parameters
        Its keywords with defaults and units.
    needs_rng
        Whether it is random.
    """

    function: Callable[..., FloatArray]
    meaning: str
    parameters: tuple[ReferenceParameter, ...] = ()
    needs_rng: bool = False

    @property
    def defaults(self) -> dict[str, float]:
        """Keyword to default value."""
        return {p.name: p.default for p in self.parameters}


Registry: TypeAlias = Mapping[str, ReferenceKind]


def sample(spec: ReferenceSpec, registry: Registry, t: FloatArray, rng: np.random.Generator | None) -> FloatArray:
    """Return the reference at given instants; see :func:`flexdrive_gym.references.sample_reference`."""
    if t.ndim != 1:
        raise ValueError(f"t: must be a vector of instants [s]; got shape {t.shape}. Pass one instant per sample.")
    if callable(spec):
        return _from_function(spec, t, rng)
    if _is_named(spec):
        return _from_name(spec, registry, t, rng)
    return _from_array(spec, len(t))


def is_random(spec: ReferenceSpec, registry: Registry) -> bool:
    """Return whether a reference draws random numbers; see :func:`flexdrive_gym.references.is_random`."""
    if callable(spec):
        return _rng_place(spec) is not None
    return _is_named(spec) and _parse(spec, registry)[1].needs_rng


def _is_named(spec: Any) -> bool:
    return isinstance(spec, str) or (isinstance(spec, tuple) and bool(spec) and isinstance(spec[0], str))


def _hint(name: str, names: Iterable[str]) -> str:
    near = get_close_matches(name, list(names), n=2, cutoff=0.5)
    return f"Did you mean {' or '.join(map(repr, near))}?" if near else f"Choose from {', '.join(names) or 'none'}."


def split(text: str) -> tuple[str, dict[str, float]]:
    """Return name and keywords of ``name`` or ``name:keyword=value:…``.

    Raises
    ------
    ValueError
        For a keyword without a number.
    """
    name, *given = text.split(":")
    keywords = {}
    for item in given:
        key, _, value = item.partition("=")
        try:
            keywords[key.strip()] = float(value)
        except ValueError as error:
            raise ValueError(
                f"reference: must be name:keyword=number:…; got {text!r}. Try sine:amplitude=10."
            ) from error
    return name.strip(), keywords


def _parse(spec: Any, registry: Registry) -> tuple[str, ReferenceKind, dict[str, float]]:
    """Return name, kind and complete keywords of a name or of a tuple (name, keywords)."""
    if isinstance(spec, str):
        spec = split(spec)
    name = spec[0]
    if name not in registry:
        raise ValueError(f"reference: no reference is called {name!r}. {_hint(name, registry)}")
    kind = registry[name]
    if len(spec) != 2 or not isinstance(spec[1], Mapping):
        raise TypeError(
            f"reference: a tuple must be (name, {{keyword: value}}); got {spec!r}. "
            f"Write ({name!r}, {kind.defaults!r}), or {name!r} alone for the defaults."
        )
    for keyword, value in spec[1].items():
        _check_keyword(name, kind, keyword, value)
    return name, kind, kind.defaults | {keyword: float(value) for keyword, value in spec[1].items()}


def _check_keyword(name: str, kind: ReferenceKind, keyword: str, value: object) -> None:
    if keyword not in kind.defaults:
        hint = _hint(str(keyword), kind.defaults) if kind.defaults else f"Write {name!r} alone: it has no keywords."
        raise ValueError(f"reference: {name!r} has no keyword {keyword!r}. {hint}")
    unit = next(p.unit for p in kind.parameters if p.name == keyword)
    remedy = f"The default is {kind.defaults[keyword]:g} {unit}."
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"reference: {keyword} of {name!r} must be a number [{unit}]; got {value!r}. {remedy}")
    if not np.isfinite(float(value)):
        raise ValueError(f"reference: {keyword} of {name!r} must be finite [{unit}]; got {value}. {remedy}")


def _check_rng(rng: np.random.Generator | None, what: str) -> None:
    if not isinstance(rng, np.random.Generator):
        raise TypeError(
            f"rng: the reference {what} is random and needs a numpy.random.Generator; got {rng!r}. "
            "Pass numpy.random.default_rng(seed)."
        )


def _from_name(spec: Any, registry: Registry, t: FloatArray, rng: np.random.Generator | None) -> FloatArray:
    name, kind, keywords = _parse(spec, registry)
    arguments: dict[str, Any] = dict(keywords)
    if kind.needs_rng:
        _check_rng(rng, repr(name))
        arguments["rng"] = rng
    try:
        return kind.function(t, **arguments)
    except ValueError as error:
        raise ValueError(f"reference: {name!r} cannot have these values. {error}") from error


def _from_array(spec: Any, n: int) -> FloatArray:
    try:
        values = np.array(spec)
    except ValueError as error:
        raise ValueError(f"reference: an array must be one-dimensional; got rows of unequal length. {error}") from error
    # a string, a dictionary or None becomes an array of something else than real numbers
    if values.dtype.kind not in "iuf" and values.size:
        raise TypeError(f"reference: must be {FORMS}; got {spec!r} of type {type(spec).__name__}.")
    if values.ndim != 1 or not values.size:
        raise ValueError(
            f"reference: an array must be one-dimensional with at least one position [mm]; got shape {values.shape}. "
            "Pass one value per sample, or a single one as [50.0] to hold it."
        )
    _check_finite(values, "an array must hold finite positions [mm]", "Fill gaps; cut its end off, the rest is held.")
    held = np.full(n, values[-1], dtype=np.float64)
    held[: len(values)] = values[:n]
    return held


def _check_finite(values: npt.NDArray[Any], rule: str, remedy: str) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        more = f" and {bad.size - 1} more" if bad.size > 1 else ""
        raise ValueError(f"reference: {rule}; got {values[bad[0]]} at sample {bad[0]}{more}. {remedy}")


def _rng_place(function: ReferenceFunction) -> str | None:
    """Return how a function wants its generator: ``"keyword"``, ``"second"`` (positional) or ``None``."""
    try:
        parameters = list(signature(function).parameters.values())
    except (TypeError, ValueError):  # some compiled functions tell nothing; they can only be functions of t
        return None
    named = any(p.name == "rng" and p.kind is not Parameter.POSITIONAL_ONLY for p in parameters)
    required = [p for p in parameters if p.default is Parameter.empty and not (named and p.name == "rng")]
    positional = [p for p in required if p.kind in (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)]
    keywords = [p for p in required if p.kind is Parameter.KEYWORD_ONLY]
    takes_t = any(p.kind not in (Parameter.KEYWORD_ONLY, Parameter.VAR_KEYWORD) for p in parameters)
    if keywords or not takes_t or len(positional) > (1 if named else 2):
        raise TypeError(
            f"reference: a function must be callable as f(t) or f(t, rng); got f{signature(function)}. "
            "Bind its other arguments with functools.partial or a lambda."
        )
    if named:
        return "keyword"
    return "second" if len(positional) == 2 else None


def _from_function(function: ReferenceFunction, t: FloatArray, rng: np.random.Generator | None) -> FloatArray:
    place = _rng_place(function)
    if place is not None:
        _check_rng(rng, repr(getattr(function, "__name__", type(function).__name__)))
    # a copy, so that a function that writes into its argument cannot shift the caller's clock
    arguments: tuple[Any, ...] = (t.copy(), rng) if place == "second" else (t.copy(),)
    try:
        values = np.array(function(*arguments, **({"rng": rng} if place == "keyword" else {})))
    except TypeError as error:
        raise TypeError(
            f"reference: the function fails on the vector of all instants, shape {t.shape}: {error}. "
            "Write it with numpy functions (numpy.sin, not math.sin) or wrap it in numpy.vectorize."
        ) from error
    if values.dtype.kind not in "iuf":
        raise TypeError(f"reference: a function must return real numbers [mm]; got an array of {values.dtype}.")
    if values.shape != t.shape:
        raise ValueError(
            f"reference: a function must return one position [mm] per instant, shape {t.shape}; got shape "
            f"{values.shape}. It is called once with all instants; for a constant return numpy.full_like(t, value)."
        )
    _check_finite(values, "a function must return finite positions [mm]", "Check it over the whole episode.")
    return values.astype(np.float64)
