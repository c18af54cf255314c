"""EMPS: one carriage on a prismatic joint under position control."""

from baselines.public_data import EMPS as BENCHMARK
from baselines.real_rigs.entry import Control, Documented, Figure, RealRig
from identification.topology import CART

LINEAR_CARRIAGE = BENCHMARK.topology
_NEWTON = 35.1507  # drive gain: newtons per volt
_PAPER = "Janot, Gautier, Brunot, 2019: inverse dynamic model"

EMPS = RealRig(
    name="emps",
    title="EMPS",
    citation=BENCHMARK.citation,
    rig=BENCHMARK.rig,
    only=BENCHMARK.train,
    topology=LINEAR_CARRIAGE,
    concealed=(
        Documented("dry friction", (("coulomb_friction", "cart_1"),), _PAPER),
        Documented(
            "forces that differ between the directions",
            (
                ("coulomb_asymmetry", "cart_1"),
                ("viscous_asymmetry", "cart_1"),
                ("input_offset", "actuator"),
                ("tilt", "guide"),
                ("gain_asymmetry", "actuator"),
            ),
            f"{_PAPER}, offset of the force",
        ),
    ),
    figures=(
        Figure("moving mass", "kg", 95.1089, lambda drive: drive["m1"] * 1e3 * _NEWTON, _PAPER),
        Figure("viscous friction", "N s/m", 203.5034, lambda drive: drive["b1"] * 1e3 * _NEWTON, _PAPER),
        Figure("dry friction", "N", 20.3935, lambda drive: drive["d1"] * _NEWTON, _PAPER),
    ),
    control=Control("lugre_servo", CART),
)
