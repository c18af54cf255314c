"""Identification of the drive from recordings: read, identify, validate."""

from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.methods import Identification, identify
from identification.recordings import RecordingError, read_recordings, write_recording
from identification.validation import Validation, validate

__all__ = [
    "Identification",
    "MaximumLikelihood",
    "RecordingError",
    "Validation",
    "identify",
    "identify_by_likelihood",
    "read_recordings",
    "validate",
    "write_recording",
]
