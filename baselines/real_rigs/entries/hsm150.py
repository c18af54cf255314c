"""Servo motor bench: steps of torque around an operating point. Nothing is concealed; nothing should be named."""

from baselines.real_rigs.entry import Figure, RealRig
from identification.topology import CART

_CATALOGUE = "the workspaces' J and B, of the motor's catalogue"

HSM150 = RealRig(
    name="hsm150",
    title="HSM150 servo motor",
    citation="repository malik-robert/HSM150-data",
    rig="""
[rig]
name = "motor bench"
carts = 1
[columns]
t = "data:1"
reference = "data:2"
x1 = "data:3"
u = "data:6"
[units]
u = "N m"
x1 = "rad"
reference = "rad"
""",
    topology=CART,
    figures=(
        Figure("J", "N m s²/rad", 0.00012, "m1", _CATALOGUE),
        Figure("B", "N m s/rad", 7.03e-05, "b1", _CATALOGUE),
    ),
)
