"""The handout's own rig in two conditions: its ratios of masses and friction, and the gain at which the rig rang."""

from __future__ import annotations

from baselines.loop_analysis.stability_limit import critical_gain
from baselines.real_rigs.entry import Figure, RealRig
from identification.topology import TWO_CARTS

_HANDOUT = "Lab 3 handout"
_RATIOS = (
    Figure("α = m2/m1", "1", 0.54, lambda drive: drive["m2"] / drive["m1"], _HANDOUT),
    Figure("β = b2/b1", "1", 0.1, lambda drive: drive["b2"] / drive["b1"], _HANDOUT),
    Figure("γ = d2/d1", "1", 0.1, lambda drive: drive["d2"] / drive["d1"], _HANDOUT),
)

MTE360_2022 = RealRig(
    name="mte360_2022",
    title="MTE 360 rig, 2022",
    citation="University of Waterloo, MTE 360, one group's recordings (repository ahmadkama/MTE360Proj3)",
    topology=TWO_CARTS,
    figures=(
        *_RATIOS,
        Figure(
            "critical gain from x2",
            "V/mm",
            0.2345,
            lambda drive: critical_gain(drive, "x2"),
            "pctrl_x2_kp0.2345_critical.csv",
        ),
    ),
)

MTE360_2025 = RealRig(
    name="mte360_2025",
    title="MTE 360 rig, 2025",
    citation="University of Waterloo, MTE 360, another group (repository Mthanson1/MTE360-Collocated-Controller-Lab3)",
    topology=TWO_CARTS,
    figures=_RATIOS,
)
