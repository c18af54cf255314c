"""The two-mass flexible drive: its physics, recordings of it, and Gymnasium environments."""

from flexdrive_gym.drive.controller import Controller, Observation
from flexdrive_gym.drive.default import DEFAULT_DRIVE
from flexdrive_gym.drive.drive import Covariance, Drive, Provenance
from flexdrive_gym.drive.linear import LinearDrive
from flexdrive_gym.drive.linear_controller import LinearController
from flexdrive_gym.drive.p_control import PControl
from flexdrive_gym.drive.toml import load_drive, save_drive
from flexdrive_gym.recording import Excitation, Fault, Recording
from flexdrive_gym.registration import register
from flexdrive_gym.version import __version__

__all__ = [
    "DEFAULT_DRIVE",
    "Controller",
    "Covariance",
    "Drive",
    "Excitation",
    "Fault",
    "LinearController",
    "LinearDrive",
    "Observation",
    "PControl",
    "Provenance",
    "Recording",
    "__version__",
    "load_drive",
    "save_drive",
]

register()
