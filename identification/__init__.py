"""Identification of the drive from recordings: read, identify, validate, diagnose."""

from identification.diagnosis_file import load_diagnosis
from identification.likelihood import MaximumLikelihood, identify_by_likelihood
from identification.methods import Identification, identify
from identification.mismatch.answer.verdict import Diagnosis
from identification.mismatch.diagnose import diagnose
from identification.readiness import Check, check
from identification.recordings import RecordingError, read_recordings, write_recording, write_rig
from identification.validation import Validation, validate

__all__ = [
    "Check",
    "Diagnosis",
    "Identification",
    "MaximumLikelihood",
    "RecordingError",
    "Validation",
    "check",
    "diagnose",
    "identify",
    "identify_by_likelihood",
    "load_diagnosis",
    "read_recordings",
    "validate",
    "write_recording",
    "write_rig",
]
