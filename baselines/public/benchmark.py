"""What a public benchmark is: how its files are read, its units, its topology, and the rule it is scored by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from baselines.public.units import Units
from flexdrive_gym.recording import Channel, FloatArray, Recording
from identification.recordings.errors import broken
from identification.recordings.faults import missing_samples
from identification.recordings.files import extension, read_table
from identification.recordings.timing import make_uniform
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
class Benchmark:
    """One public data set.

    Attributes
    ----------
    name, title, citation
        For the command, headings and those who use its figures.
    train, test
        Patterns of file names.
    read
        Makes a recording of a file, in the engine's units.
    topology, units, rule
        Of the rig.
    columns, published
        Headings of the published table and its rows.
    hold_out
        Divides the training recordings into what is learnt from and what is kept for validation.
    column_of
        Returns in which column of the table a recording is scored.
    without_extrapolation
        Column to another one, in which the same recording is scored up to where its output leaves the range of training.
    """

    name: str
    title: str
    citation: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    read: Callable[[Path], Recording]
    topology: Topology
    units: Units
    rule: Rule
    columns: tuple[str, ...]
    published: tuple[Published, ...]
    hold_out: Callable[[Sequence[Recording]], tuple[tuple[Recording, ...], tuple[Recording, ...]]]
    column_of: Callable[[Recording], int] = lambda _: 0
    without_extrapolation: Mapping[int, int] = field(default_factory=dict)

    def files(self, folder: Path, patterns: Sequence[str]) -> list[Path]:
        """Return the files of a folder that match, in order of their names."""
        return sorted({p for pattern in patterns for p in folder.glob(pattern) if p.is_file()})

    def score(self, error: FloatArray) -> float:
        """Return the figure of a simulation error [engine's mm or mm/s], the window left out."""
        rms = float(np.sqrt(np.mean(np.square(error[self.rule.window :]))))
        return rms / self.scale * self.rule.per_output

    @property
    def scale(self) -> float:
        """Engine's units in one unit of the rig's output."""
        return self.units.length


def read_columns(path: Path, units: Units, channel: Channel, column: str) -> Recording:
    """Read columns t_s, u_V and one of an output; what is missing is interpolated and a fault.

    Parameters
    ----------
    path
        A ``.csv``, ``.csv.gz`` or ``.mat`` file.
    units
        Of the rig.
    channel, column
        What the output is, and its name in the file.

    Returns
    -------
    Recording
        In the engine's units, named as the file.

    Raises
    ------
    RecordingError
        If a column is not there, or the file cannot be read.
    """
    table = read_table(path)
    columns = dict(zip(table.labels, table.values, strict=True))
    wanted = ("t_s", "u_V", column)
    if any(label not in columns for label in wanted):
        rule, got = f"must be {', '.join(wanted)}", ", ".join(columns)
        raise broken(path.name, "columns", rule, got, "Name them so in the header.")
    t, u, y = (columns[label] for label in wanted)
    scale = units.length if channel[0] == "x" else units.length / units.time
    uniform = make_uniform(t * units.time, {"u": u * units.voltage, channel: y * scale}, path.name)
    name = path.name[: len(path.name) - len(extension(path))]
    notes = (*table.notes, *uniform.notes)
    faults = missing_samples(uniform, name)
    return Recording(name, uniform.t, **uniform.signals, faults=faults, notes=notes, source=path.name)  # type: ignore[arg-type]


def piece(recording: Recording, begin: int, end: int, name: str) -> Recording:
    """Return samples ``begin`` to ``end`` of a recording, which keep their clock."""
    signals = {
        key: values[begin:end]
        for key in ("t", "u", "x1", "x2", "v1", "v2", "xr")
        if (values := getattr(recording, key)) is not None
    }
    return replace(recording, name=name, **signals)
