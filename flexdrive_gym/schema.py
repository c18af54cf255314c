"""Schemas of files: the number that a file carries, and the steps that bring an older file to the present form.

A number goes up only where a program written for the old form would misread or miss something; a key that may be absent is
added without one. Every number since the first release is read (``docs/compatibility.md``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

Document = dict[str, Any]


@dataclass(frozen=True)
class Schema:
    """The present form of a kind of file.

    Attributes
    ----------
    number
        What ``schema`` says in a file of this form.
    remedy
        What to do about a file that has no such number.
    steps
        From a number to the function that makes the next form's document of a document of this form.
    """

    number: int
    remedy: str
    steps: Mapping[int, Callable[[Document], Document]] = field(default_factory=dict)

    def current(self, document: Document, where: str) -> Document:
        """Return the document in the present form; ``document`` stays as it is.

        Raises
        ------
        ValueError
            If it has no number, or one that is not known here; ``where`` names the file.
        """
        found = document.get("schema")
        if not isinstance(found, int) or isinstance(found, bool) or found < 1:
            raise ValueError(f"{where}: must have 'schema' from 1 to {self.number}; got {found!r}. {self.remedy}")
        if found > self.number:
            raise ValueError(
                f"{where}: has schema {found}, and this flexdrive reads up to {self.number}. Update flexdrive."
            )
        for number in range(found, self.number):
            document = {**self.steps[number](document), "schema": number + 1}
        return document
