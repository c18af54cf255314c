"""The compiled step in another language."""

from __future__ import annotations

from baselines.export.translation.entry import first_sample, one_sample
from baselines.export.translation.function import UntranslatableError
from baselines.export.translation.placement import field_name
from baselines.export.translation.translator import Translation, Translator, constants_in

__all__ = [
    "Translation",
    "Translator",
    "UntranslatableError",
    "constants_in",
    "field_name",
    "first_sample",
    "one_sample",
]
