"""The bundled sample: a data set that flexdrive itself simulated, not a recording of a rig.

It shows every part of the report and of a diagnosis without data of anybody else's; its cart 1 has a Stribeck effect.
:mod:`baselines.lab.sample.make` wrote it.
"""

from pathlib import Path

FOLDER = Path(__file__).parent / "lab_day"
