"""What a comparison found, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from baselines.compare.cases import Case
from baselines.compare.result import Group, Result
from baselines.compare.tables import Table, margins_table, robustness_table, tracking_table
from flexdrive_gym import Drive
from flexdrive_gym.units import in_rig_units, measured_in


@dataclass(frozen=True, eq=False)
class Comparison:
    """All controllers on all cases.

    Attributes
    ----------
    results
        In the order of the entries.
    skipped
        Controller to the reason why it is not there.
    """

    drive: Drive
    cases: tuple[Case, ...] = field(metadata=measured_in(None))
    results: tuple[Result, ...]
    limit: float = field(metadata=measured_in("V"))
    tolerance: float = field(metadata=measured_in("mm"))
    duration: float = field(metadata=measured_in("s"))
    seed: int
    skipped: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return "\n\n".join(str(table) for table in self.tables())

    def tables(self) -> list[Table]:
        """Return tracking, margins and robustness in the rig's units."""
        units, shown = self.drive.units, in_rig_units(self, self.drive.units)
        made = (
            tracking_table(shown.drive, shown.limit, shown.results),
            margins_table(shown.results, units),
            robustness_table(shown.results),
        )
        return [table.of_rig(units) for table in made]

    @property
    def groups(self) -> tuple[Group, ...]:
        """Results by group, in the order of the entries."""
        members: dict[str, list[Result]] = {}
        for r in self.results:
            members.setdefault(r.entry.group or r.entry.name, []).append(r)
        return tuple(Group(name, tuple(found)) for name, found in members.items())

    @property
    def references(self) -> tuple[str, ...]:
        """Names of the references beside the handout's trajectory."""
        return tuple(dict.fromkeys(str(c.reference) for c in self.cases if not c.handout))

    def where(self, group: str | None = None, reference: str | None = None) -> np.ndarray:
        """Return the numbers of the cases of a group along a reference; ``None`` for the handout's trajectory.

        Without a group it is the drawn drives, or the identified one where none were drawn.
        """
        along = [
            c.handout if reference is None else not c.handout and str(c.reference) == reference for c in self.cases
        ]
        if group is None:
            drawn = [a and c.group == "draw" for a, c in zip(along, self.cases, strict=True)]
            group = "draw" if any(drawn) else "nominal"
        return np.flatnonzero([a and c.group == group for a, c in zip(along, self.cases, strict=True)])
