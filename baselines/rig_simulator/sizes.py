"""Strengths that are plainly present; made by ``python -m baselines.rig_simulator.calibrate``.

Per effect and place: strength, rms change of velocity, and what a refit of the baseline leaves of that change; the
latter two in floors of 2.9 mm/s, over the third of the velocity channels in which the effect acts most.
"""

from __future__ import annotations

from collections.abc import Mapping

SIZES: Mapping[str, tuple[float, float, float]] = {
    "amplifier_lag@actuator": (1.29, 3.49, 1.94),
    "asymmetric_spring@spring": (0.765, 2.16, 2.1),
    "breakaway@cart_1": (4, 1.12, 0.9),
    "breakaway@cart_2": (4, 2.95, 1.83),
    "cogging@drivetrain": (1.59, 2.12, 1.89),
    "coil_bind@spring": (1, 3.88, 1.31),
    "command_friction@outside": (0.797, 4.16, 0.34),
    "coulomb_asymmetry@cart_1": (1.85, 1.97, 1.97),
    "coulomb_asymmetry@cart_2": (3.31, 1.95, 1.95),
    "coupling_backlash@spring": (1.81, 3.84, 1.46),
    "cubic_brake_with_resonance@outside": (0.131, 4.36, 0.84),
    "dead_zone@actuator": (1, 4.17, 0.57),
    "encoder_delay@encoder_1": (1.29, 2.78, 1.89),
    "encoder_delay@encoder_2": (1.3, 1.66, 0.87),
    "encoder_eccentricity@encoder_2": (1.34, 1.92, 1.9),
    "encoder_play@encoder_1": (0.461, 2.21, 2.11),
    "encoder_play@encoder_2": (1.3, 2.05, 1.93),
    "encoder_scale@encoder_2": (1, 1.39, 0.74),
    "extra_mode@structure": (0.901, 4.1, 1.03),
    "friction_drift@cart_1": (0.461, 2.07, 2.04),
    "friction_drift@cart_2": (1.24, 2.03, 1.93),
    "friction_since_reversal@outside": (1.85, 3.93, 1.67),
    "gain_asymmetry@actuator": (1.23, 1.93, 1.93),
    "gain_drift@actuator": (1.34, 3.8, 1.41),
    "ground_spring@guide": (0.303, 2.26, 2.07),
    "hardening_spring@spring": (0.517, 4.13, 1.62),
    "inertial_coupling@outside": (0.496, 3.95, 2.02),
    "input_delay@actuator": (1.29, 2.96, 1.89),
    "input_offset@actuator": (1.33, 1.9, 1.9),
    "load_friction@cart_1": (3.93, 3.78, 0.99),
    "load_friction@cart_2": (2.03, 3.93, 0.81),
    "magnet_detent@outside": (0.415, 2.63, 2.03),
    "motor_gear_backlash@drivetrain": (1, 2.21, 2.13),
    "one_sided_stop@outside": (0.0895, 2.51, 2.37),
    "periodic_disturbance@outside": (0.404, 2.04, 2.04),
    "position_friction@cart_1": (0.461, 3.35, 2.02),
    "position_friction@cart_2": (0.703, 3.98, 2.11),
    "presliding@cart_1": (4.1, 3.75, 1.57),
    "presliding@cart_2": (1, 2.87, 1.94),
    "quadratic_drag@cart_1": (0.68, 4.16, 0.32),
    "quadratic_drag@cart_2": (0.287, 4.27, 0.53),
    "random_impacts@outside": (0.459, 2.04, 2.04),
    "saturation@actuator": (2.73, 3.78, 1.48),
    "slew_limit@outside": (0.541, 2.27, 2),
    "slipping_belt@outside": (1.25, 2.55, 1.9),
    "spring_damping@spring": (0.419, 4.11, 1.78),
    "spring_hysteresis@spring": (1.61, 3.94, 1.97),
    "stribeck@cart_1": (3, 1.43, 0.85),
    "stribeck@cart_2": (3, 2.85, 1.55),
    "tilt@guide": (1.33, 1.9, 1.9),
    "viscous_asymmetry@cart_1": (0.659, 2.15, 2.14),
    "viscous_asymmetry@cart_2": (2.12, 1.97, 1.97),
}
