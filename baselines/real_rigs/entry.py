"""What an entry says of a rig: its files, what their columns mean, the base model, and what its documentation says is there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from flexdrive_gym import Drive
from flexdrive_gym.recording import Recording
from identification.recordings import RecordingSet, Rig, read_recordings
from identification.recordings.rig import parse_rig
from identification.topology import Topology

Effect = tuple[str, str]


@dataclass(frozen=True)
class Documented:
    """One physical effect that a rig has, by its documentation.

    Attributes
    ----------
    label
        In words.
    names
        Ids and places of the catalogue that stand for it: any of them names it.
    source
        Where it is written.
    """

    label: str
    names: tuple[Effect, ...]
    source: str


@dataclass(frozen=True)
class Figure:
    """A parameter that the documentation gives.

    Attributes
    ----------
    label, unit
        What is compared, in the rig's units.
    documented
        Value.
    found
        Name of the drive's parameter, or the function of the drive that gives the same figure in these units.
    source
        Where it is written.
    """

    label: str
    unit: str
    documented: float
    found: str | Callable[[Drive], float | None]
    source: str


@dataclass(frozen=True)
class Control:
    """The base model of a rig that looks alike in what it lacks.

    Attributes
    ----------
    of
        Name of that rig.
    topology
        Its base model.
    """

    of: str
    topology: Topology


@dataclass(frozen=True)
class RealRig:
    """One rig.

    Attributes
    ----------
    name, title
        Name of its folder and of the rig.
    citation
        Whose recordings they are.
    rig
        Its ``rig.toml``, as text or as read.
    topology
        Base model, without what is concealed; ``None``: as the recordings' channels tell.
    concealed
        What the base model lacks, by the documentation.
    denied
        Ids that the documentation contradicts, with the reason.
    figures
        Parameters that the documentation gives.
    only
        Patterns of the files to read.
    told
        Adds to a recording what its file cannot say.
    control
        Base model of another rig that nothing may be named by mistake with.
    """

    name: str
    title: str
    citation: str
    rig: str | Rig = ""
    topology: Topology | None = None
    concealed: tuple[Documented, ...] = ()
    denied: Mapping[str, str] = field(default_factory=dict)
    figures: tuple[Figure, ...] = ()
    only: tuple[str, ...] = ()
    told: Callable[[Recording], Recording] = lambda recording: recording
    control: Control | None = None

    def read(self, data: Path) -> RecordingSet:
        """Return the rig's recordings from its folder under ``data``.

        Raises
        ------
        RecordingError
            If nothing there can be read.
        """
        rig = parse_rig(self.rig, f"{self.name}/rig.toml") if isinstance(self.rig, str) else self.rig
        found = read_recordings(data / self.name, rig=rig, only=self.only)
        return RecordingSet((self.told(r) for r in found), found.skipped, found.rig)


Outcome = Literal["named", "tied", "missed"]
