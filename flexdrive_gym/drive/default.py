"""The drive that an environment has when nobody names one."""

from __future__ import annotations

from flexdrive_gym.drive.drive import Drive, Provenance

# maximum likelihood on the student recordings of winter 2022 (python -m benchmarks real_rigs), three digits
DEFAULT_DRIVE = Drive(
    {
        "m1": 7.63e-4,
        "m2": 3.43e-4,
        "b1": 9.45e-3,
        "b2": 3.18e-3,
        "d1": 0.360,
        "d2": 0.247,
        "k": 0.0961,
        "saturation.limit": 8.0,
        "encoder_quantisation.encoder_1.quantum": 0.0046592,
        "encoder_quantisation.encoder_2.quantum": 0.0046592,
    },
    provenance=Provenance(
        "ml", ("mte360_2022",), note="rig of the Lab 3 handout, winter 2022; rounded to three digits"
    ),
    name="laboratory rig, winter 2022",
)
