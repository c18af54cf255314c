"""Controllers on rigs of any size: the laboratory's tasks on the scale of the rig.

The handout's references, limits and thresholds (50 mm, 2.5 V, a swing of 25 mm) are sensible for the handout's rig. Another rig
is brought to them by a choice of units: what its recordings reach with the command is the lab's largest excitation, and a move
that they cover is the lab's 50 mm. Everything that is designed, run and judged keeps its form there, and everything that is
told goes back through :func:`~flexdrive_gym.units.in_rig_units`.

A move is covered where a cart went as far, and where the speed of the handout's trajectory, twice the stroke in a second, is at
most half of the largest one recorded; by this rule the open-loop recordings of the handout's own rig give 32 to 44 mm.
"""

from __future__ import annotations

from dataclasses import replace

from flexdrive_gym import Drive
from flexdrive_gym.references import SPEED_MM_S, STROKE_MM

# the largest command of the lab's open-loop experiments, 2.6
EXCITATION_V = 2.5
_SHARE_OF_SPEED = 0.5


def on_lab_scale(drive: Drive) -> Drive:
    """Return the same physical drive on the scale of the laboratory's tasks.

    Parameters
    ----------
    drive
        In the lab's own units it stays as it is. Another one needs what its recordings reached (``[recorded]`` of its file);
        without it, the factors of the file's ``[units]`` say what 50 mm and 2.5 V are.
    """
    reached, units = drive.recorded, drive.units
    if units.lab or reached is None:
        return drive
    # a speed in the engine's units becomes the stroke that the handout's time law covers at a share of it
    strokes = [reached.travel, _SHARE_OF_SPEED * reached.v * STROKE_MM / SPEED_MM_S]
    stroke = min((s for s in strokes if s > 0.0), default=STROKE_MM)
    command = reached.u if reached.u > 0.0 else EXCITATION_V
    return drive.rescaled(
        replace(
            units,
            per_length=units.per_length * STROKE_MM / stroke,
            per_command=units.per_command * EXCITATION_V / command,
        )
    )
