"""Compile what the page needs before the first visitor waits for it; a fresh installation compiles once and keeps the result."""

from __future__ import annotations

from baselines.lab_page.motion import controller_of, simulate
from baselines.lab_page.settings import Settings
from baselines.lab_page.signature import signature
from baselines.lab_page.stability_lamp import swing
from flexdrive_gym import DEFAULT_DRIVE, LinearController

# one effect of a force and one with a memory: after them every variant of the step is there
_EFFECTS = {"coupling_backlash.g": 0.5}


def warm_up() -> None:
    """Run everything once: motion, lamp and signature, with base effects alone and with all."""
    for settings in (Settings(), Settings(effects=_EFFECTS), Settings(controller="square")):
        controller = controller_of(settings, DEFAULT_DRIVE)
        simulate(settings, DEFAULT_DRIVE, controller)
        if isinstance(controller, LinearController):
            swing(DEFAULT_DRIVE.replace(dict(settings.effects)), controller, 1.0)
    signature(DEFAULT_DRIVE, _EFFECTS)
