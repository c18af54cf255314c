"""From quantities to places on the picture: linear scales, round ticks and numbers as text."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, isfinite, log10

from flexdrive_gym.recording import FloatArray
from flexdrive_gym.units import Units


@dataclass(frozen=True)
class Scale:
    """A linear map that takes ``low`` to ``start`` and ``high`` to ``end``."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Return the place of a value."""
        return self.start + (value - self.low) * self.slope

    def places(self, values: FloatArray) -> FloatArray:
        """Return the places of values, ndarray, shape (n,)."""
        return self.start + (values - self.low) * self.slope

    @property
    def slope(self) -> float:
        """Place per unit of the quantity."""
        return (self.end - self.start) / (self.high - self.low)

    def ticks(self, most: int) -> list[float]:
        """Return at most about ``most`` round values within the scale."""
        step = round_step((self.high - self.low) / most)
        first, last = ceil(self.low / step - 1e-9), floor(self.high / step + 1e-9)
        return [k * step for k in range(first, last + 1)]


def round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is at least ``least``."""
    power = 10.0 ** floor(log10(least))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least * (1.0 - 1e-9))


def round_out(low: float, high: float, parts: int = 4) -> tuple[float, float]:
    """Return the range widened to round values."""
    step = round_step((high - low) / parts)
    return floor(low / step + 1e-9) * step, ceil(high / step - 1e-9) * step


def reading(value: float, unit: str, units: Units, digits: int | None = None) -> str:
    """Return a figure of the rig with the rig's name of the lab's ``unit``; ``digits`` decimals suit the lab's alone."""
    if units.lab:
        return f"{text(value, digits)} {unit}"
    return f"{text(float(f'{value:.4g}'))} {units.name(unit)}"


def text(value: float, digits: int | None = None) -> str:
    """Return a number with a true minus sign; a dash where there is none."""
    if not isfinite(value):
        return "–"
    # a run that diverges must not write hundreds of digits
    form = "g" if digits is None else f".{digits}f" if abs(value) < 1e6 else ".4g"
    written = f"{value:{form}}"
    # a small negative number must not read -0.00
    return written.lstrip("-") if float(written) == 0.0 else written.replace("-", "−")
