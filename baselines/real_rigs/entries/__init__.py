"""The rigs, one file each."""

from baselines.real_rigs.entries.coupled_drives import COUPLED_DRIVES
from baselines.real_rigs.entries.ecp210 import ECP210
from baselines.real_rigs.entries.emps import EMPS
from baselines.real_rigs.entries.hsm150 import HSM150
from baselines.real_rigs.entries.lugre_servo import LUGRE_SERVO
from baselines.real_rigs.entries.mte360 import MTE360_2022, MTE360_2025
from baselines.real_rigs.entries.quanser import QUANSER
from baselines.real_rigs.entries.silverbox import SILVERBOX

RIGS = {
    rig.name: rig
    for rig in (
        ECP210, LUGRE_SERVO, EMPS, COUPLED_DRIVES, SILVERBOX, QUANSER, HSM150, MTE360_2022, MTE360_2025
    )
}  # fmt: skip

__all__ = ["RIGS"]
