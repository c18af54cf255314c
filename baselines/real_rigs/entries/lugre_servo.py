"""A servo axis in torque mode, recorded to identify a LuGre model: some runs stay below breakaway.

Six recordings of each kind. One of the others, ``LuGre_01``, has the opposite constant force: with it none is one of the rig.
"""

from baselines.real_rigs.entries.emps import LINEAR_CARRIAGE
from baselines.real_rigs.entry import Control, Documented, Figure, RealRig
from identification.topology import CART

_AUTHOR = "LuGre identification of the author; does not describe the files (recordings' README)"

LUGRE_SERVO = RealRig(
    name="lugre_servo",
    title="LuGre servo axis",
    citation="repository TeacherRock/LuGre_Friction",
    rig="""
[rig]
name = "servo axis"
carts = 1
sample_time = 0.001
[columns]                                       # no header
x1 = "1"
v1 = "2"
u = "5"
[units]
x1 = "rad"
v1 = "rad/s"
u = "N m"
""",
    only=("LuGre_*_[1-6].txt",),
    topology=CART,
    concealed=(
        Documented(
            "presliding", (("presliding", "cart_1"),), "sigma0_*: a sine below breakaway moves the axis by ±1.9 mrad"
        ),
        Documented(
            "constant force",
            (("input_offset", "actuator"), ("tilt", "guide"), ("coulomb_asymmetry", "cart_1")),
            "J_*: more friction backwards than forwards",
        ),
    ),
    figures=(
        Figure("J", "N m s²/rad", 1.759e-4, "m1", _AUTHOR),
        Figure("Coulomb friction", "N m", 0.0149, "d1", _AUTHOR),
    ),
    control=Control("emps", LINEAR_CARRIAGE),
)
