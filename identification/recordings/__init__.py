"""Recordings of the rig: reading, checking, recognising what drove them and finding their faults."""

from identification.recordings.errors import RecordingError
from identification.recordings.faults import find_faults
from identification.recordings.reader import read_recordings
from identification.recordings.recognise import recognise_excitation
from identification.recordings.recording_set import RecordingSet, Skipped
from identification.recordings.rig import Rig, load_rig
from identification.recordings.writer import write_recording, write_rig

__all__ = [
    "RecordingError",
    "RecordingSet",
    "Rig",
    "Skipped",
    "find_faults",
    "load_rig",
    "read_recordings",
    "recognise_excitation",
    "write_recording",
    "write_rig",
]
