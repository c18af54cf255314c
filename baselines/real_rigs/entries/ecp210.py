"""ECP 210 rectilinear plant: motor cart, spring, second cart; the first one is also held by a spring to the frame."""

from baselines.real_rigs.entry import Documented, Figure, RealRig
from identification.topology import Topology

_COUNTS = 226.6  # per millimetre
_MODEL = "students_parameters.m"

ECP210 = RealRig(
    name="ecp210_2025",
    title="ECP 210",
    citation="University of California, MAE 171A, 2025 (repository colin-szeto/mae171A)",
    rig="""
[rig]
name = "ECP 210"
[columns]
u = ["duty", "Control Effort"]
x1 = ["enc1", "Encoder 1 Pos"]
x2 = ["enc2", "Encoder 2 Pos"]
reference = "target_v"
[units]
u = { unit = "V", factor = 0.001221 }           # 819 units of the converter per volt
x1 = { unit = "mm", factor = 0.004413 }         # 226.6 counts per millimetre
x2 = { unit = "mm", factor = 0.004413 }
reference = { unit = "mm", factor = 0.004413 }
[[files]]
match = "closed_loop_mat/*"
units = { u = { unit = "V", factor = -0.001221 } }
""",
    topology=Topology("two carts and a spring, without dry friction", 2, ("m1", "m2", "b1", "b2", "k")),
    concealed=(
        Documented("spring from cart 1 to ground", (("ground_spring", "guide"),), "handout.pdf, figure 1"),
        Documented(
            "dry friction of cart 1", (("coulomb_friction", "cart_1"),), "free decay: the peaks' decrement grows"
        ),
        Documented(
            "dry friction of cart 2", (("coulomb_friction", "cart_2"),), "free decay: the peaks' decrement grows"
        ),
    ),
    figures=(
        Figure("m1", "V s²/mm", 1.5 * 3.2539e-07 * _COUNTS, "m1", _MODEL),
        Figure("m2", "V s²/mm", 0.8 * 6.7591e-07 * _COUNTS, "m2", _MODEL),
        Figure("k between the carts", "V/mm", 0.8 * 1.6325e-04 * _COUNTS, "k", _MODEL),
        Figure("k to ground", "V/mm", 0.99 * 1.7539e-04 * _COUNTS, "ground_spring.kg", _MODEL),
    ),
)
