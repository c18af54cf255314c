"""What a public benchmark is: its rig description, its topology, and the rule it is scored by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flexdrive_gym.drive.effects import Where
from flexdrive_gym.recording import FloatArray, Recording
from flexdrive_gym.units import Units
from identification.recordings import Rig, read_recordings
from identification.recordings.rig import scaled
from identification.topology import Topology


@dataclass(frozen=True)
class Rule:
    """How a benchmark is scored: rms error of a free simulation.

    Attributes
    ----------
    window
        First samples that may be used to find the start state; they are not scored.
    unit, per_output
        Of the figure, and how many of it make one unit of the rig's output.
    """

    window: int
    unit: str
    per_output: float = 1.0


@dataclass(frozen=True)
class Published:
    """A published method and its figures, one per column of the table."""

    method: str
    figures: tuple[float, ...]


@dataclass(frozen=True)
class Hypothesis:
    """Physics that a data set's documentation or its pictures suggest: one more structure, fitted from far away.

    A search that adds one effect at a time stays near where it begins. A structure that needs several at once is tried as a
    whole, and the blocks that are left out say what it is worth.

    Attributes
    ----------
    name
        In words.
    effects
        Ids and places.
    start
        Values to start from.
    """

    name: str
    effects: tuple[tuple[str, Where], ...]
    start: Mapping[str, float]


@dataclass(frozen=True)
class Benchmark:
    """One public data set.

    Attributes
    ----------
    name, title, citation
        For the command, headings and those who use its figures.
    train, test
        Patterns of file names.
    rig
        What the columns of its files mean, and their units.
    topology, rule
        Of the rig.
    columns, published
        Headings of the published table and its rows.
    blocks
        Contiguous blocks that every training recording is cut into: each block of all recordings is left out once.
    horizon
        Time [engine's s] over which errors of position build up, where the output is a position that may drift; else ``None``.
    known
        Adds to a recording what its file cannot say.
    column_of
        Returns in which column of the table a recording is scored.
    hypotheses
        Structures that are averaged beside those around the findings.
    without_extrapolation
        Column to another one, in which the same recording is scored up to where its output leaves the range of training.
    """

    name: str
    title: str
    citation: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    rig: Rig
    topology: Topology
    rule: Rule
    columns: tuple[str, ...]
    published: tuple[Published, ...]
    blocks: int
    horizon: float | None = None
    known: Callable[[Recording], Recording] = lambda recording: recording
    column_of: Callable[[Recording], int] = lambda _: 0
    hypotheses: tuple[Hypothesis, ...] = ()
    without_extrapolation: Mapping[int, int] = field(default_factory=dict)

    def read(self, path: Path) -> Recording:
        """Return the recording in a file, in the engine's units."""
        return self.known(read_recordings([path], rig=self.rig, strict=True)[0])

    def files(self, folder: Path, patterns: Sequence[str]) -> list[Path]:
        """Return the files of a folder that match, in order of their names."""
        return sorted({p for pattern in patterns for p in folder.glob(pattern) if p.is_file()})

    def score(self, error: FloatArray) -> float:
        """Return the figure of a simulation error [engine's mm or mm/s], the window left out."""
        return self.figure(error[self.rule.window :])

    def figure(self, scored: FloatArray) -> float:
        """Return the figure of the errors of the samples that are scored."""
        return float(np.sqrt(np.mean(np.square(scored)))) / self.units.per_length * self.rule.per_output

    @property
    def units(self) -> Units:
        """The rig's units; their scale is part of its description."""
        return scaled(self.rig, 1.0, 1.0)


def piece(recording: Recording, begin: int, end: int, name: str) -> Recording:
    """Return samples ``begin`` to ``end`` of a recording, which keep their clock."""
    signals = {
        key: values[begin:end]
        for key in ("t", "u", "x1", "x2", "v1", "v2", "xr")
        if (values := getattr(recording, key)) is not None
    }
    return replace(recording, name=name, **signals)
