"""What is known of the handout's rig: encoder, amplifier, and the drive an environment has when nobody names one."""

from __future__ import annotations

from flexdrive_gym.drive.drive import Drive, Provenance

HANDOUT_QUANTUM_MM = 0.0046592
HANDOUT_LIMIT_V = 8.0

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
        "saturation.limit": HANDOUT_LIMIT_V,
        "encoder_quantisation.encoder_1.quantum": HANDOUT_QUANTUM_MM,
        "encoder_quantisation.encoder_2.quantum": HANDOUT_QUANTUM_MM,
    },
    provenance=Provenance(
        "ml", ("mte360_2022",), note="rig of the Lab 3 handout, winter 2022; rounded to three digits"
    ),
    name="laboratory rig, winter 2022",
)
