"""Quanser serial flexible link, first stage: a motor with harmonic drive behind a flexible strip, in closed loop."""

from baselines.real_rigs.entry import Documented, Figure, RealRig
from identification.topology import Topology

_MAKER = "config_2dslf.m"

QUANSER = RealRig(
    name="quanser_2dsfl",
    title="Quanser 2-DOF serial flexible link",
    citation="repository basta/quanser-2-dof-serial-flexible-link (MIT licence)",
    rig="""
[rig]
name = "2-DOF serial flexible link"
[columns]
t = "data_Im1:1"
u = "data_Im1:3"
x1 = "data_th11:3"
x2 = "data_th11:3 + data_th12:3"                # the strain gauge measures the deflection
reference = "data_th11:2"
[units]
u = { unit = "N m", factor = 8.925 }            # newton metres per ampere
x1 = { unit = "rad", factor = 0.017453 }
x2 = { unit = "rad", factor = 0.017453 }
reference = { unit = "rad", factor = 0.017453 }
""",
    only=("lqr_full*",),
    topology=Topology("two inertias and a strip, without dry friction", 2, ("m1", "m2", "b1", "b2", "k")),
    concealed=(
        Documented(
            "dry friction at the joint",
            (("coulomb_friction", "cart_1"),),
            "the joint rests 0.37° short while 0.1 A flow (lqr_full_10deg.mat)",
        ),
    ),
    figures=(
        Figure("joint's inertia", "kg m²", 0.0635362, "m1", _MAKER),
        Figure("link's inertia", "kg m²", 0.170434, "m2", _MAKER),
        Figure("strip", "N m/rad", 39.957, "k", _MAKER),
        Figure("joint's viscous friction", "N m s/rad", 4.0, "b1", _MAKER),
    ),
)
