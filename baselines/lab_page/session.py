"""What one visitor's page holds: drives, settings, recordings. Nothing of it is shared with another visitor."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from secrets import token_urlsafe
from weakref import WeakValueDictionary

from baselines.lab_page.settings import Settings
from flexdrive_gym import DEFAULT_DRIVE, Controller, Drive

BUNDLED = "rig2022"
# shown beside: the same drive without the effects that are switched on
PLAIN = "plain"


# token to visitor, for the addresses that files are sent to and fetched from; a visitor who left is gone
SESSIONS: WeakValueDictionary[str, Session] = WeakValueDictionary()


def close_all() -> None:
    """Remove what every visitor brought, when the server ends."""
    for session in list(SESSIONS.values()):
        session.close()


@dataclass(frozen=True)
class Lab:
    """What the command line gave: the same for every visitor, and never changed.

    Attributes
    ----------
    drives
        Key to drive, the first is shown first.
    recordings
        Files or folders to begin with.
    rig
        Description of their columns.
    exercise
        Whether the page opens with the exercise.
    strict, only, skip
        How the recordings to begin with are read; what visitors bring is read whole.
    """

    drives: Mapping[str, Drive] = field(default_factory=lambda: {BUNDLED: DEFAULT_DRIVE})
    recordings: Sequence[Path] = ()
    rig: Path | None = None
    exercise: bool = False
    strict: bool = False
    only: Sequence[str] = ()
    skip: Sequence[str] = ()


class Session:
    """One visitor.

    Attributes
    ----------
    lab
        What the command line gave.
    drives
        The lab's and the visitor's own.
    settings
        As chosen now.
    own
        The visitor's controller file.
    token
        Names the session where files are sent to.
    """

    def __init__(self, lab: Lab, settings: Settings) -> None:
        self.lab = lab
        self.drives: dict[str, Drive] = dict(lab.drives)
        first = next(iter(self.drives))
        known = settings.drive if settings.drive in self.drives else first
        beside = settings.beside if settings.beside in {*self.drives, PLAIN} else ""
        self.settings = settings.replace(drive=known, beside=beside)
        self.own: Controller | None = None
        self.token = token_urlsafe(16)
        self._folder: Path | None = None
        SESSIONS[self.token] = self

    @property
    def drive(self) -> Drive:
        """The drive that is chosen."""
        return self.drives[self.settings.drive]

    @property
    def folder(self) -> Path:
        """A folder of this visitor alone; it goes when the visitor does."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="flexdrive-lab-"))
        return self._folder

    def add_drive(self, key: str, drive: Drive) -> None:
        """Offer another drive to this visitor; one of the same key is replaced."""
        self.drives[key] = drive

    def close(self) -> None:
        """Remove everything the visitor brought."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None
