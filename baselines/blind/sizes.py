"""Strengths that are plainly present; made by ``python -m baselines.blind.calibrate``.

Per effect and place: strength, rms change of velocity, and what a refit of the baseline leaves of that change; the
latter two in floors of 2.9 mm/s, over the third of the velocity channels in which the effect acts most.
"""

from __future__ import annotations

from collections.abc import Mapping

SIZES: Mapping[str, tuple[float, float, float]] = {
    "amplifier_lag@actuator": (0.835, 2.32, 1.39),
    "asymmetric_spring@spring": (0.542, 1.51, 1.49),
    "breakaway@cart_1": (4, 1.12, 0.9),
    "breakaway@cart_2": (2.93, 1.54, 0.91),
    "cogging@drivetrain": (1.12, 1.48, 1.31),
    "coil_bind@spring": (0.916, 3.62, 1.23),
    "command_friction@outside": (0.711, 3.71, 0.32),
    "coulomb_asymmetry@cart_1": (1.33, 1.43, 1.42),
    "coulomb_asymmetry@cart_2": (2.49, 1.47, 1.47),
    "coupling_backlash@spring": (1.54, 3.32, 1.26),
    "cubic_brake_with_resonance@outside": (0.106, 3.81, 0.74),
    "dead_zone@actuator": (0.861, 3.59, 0.5),
    "encoder_delay@encoder_1": (0.893, 1.93, 1.33),
    "encoder_delay@encoder_2": (1.3, 1.66, 0.87),
    "encoder_eccentricity@encoder_2": (1, 1.43, 1.42),
    "encoder_play@encoder_1": (0.293, 1.59, 1.53),
    "encoder_play@encoder_2": (0.901, 1.57, 1.49),
    "encoder_scale@encoder_2": (1, 1.39, 0.74),
    "extra_mode@structure": (0.804, 3.68, 0.89),
    "friction_drift@cart_1": (0.343, 1.54, 1.52),
    "friction_drift@cart_2": (0.927, 1.52, 1.44),
    "friction_since_reversal@outside": (1.37, 2.94, 1.24),
    "gain_asymmetry@actuator": (1, 1.57, 1.57),
    "gain_drift@actuator": (1.19, 3.39, 1.26),
    "ground_spring@guide": (0.18, 1.54, 1.43),
    "hardening_spring@spring": (0.431, 3.45, 1.3),
    "inertial_coupling@outside": (0.329, 2.64, 1.32),
    "input_delay@actuator": (0.891, 2.06, 1.33),
    "input_offset@actuator": (1, 1.43, 1.43),
    "load_friction@cart_1": (3.43, 3.33, 0.88),
    "load_friction@cart_2": (1.78, 3.45, 0.73),
    "magnet_detent@outside": (0.27, 1.72, 1.36),
    "motor_gear_backlash@drivetrain": (0.568, 1.57, 1.53),
    "one_sided_stop@outside": (0.0496, 1.77, 1.68),
    "periodic_disturbance@outside": (0.305, 1.54, 1.54),
    "position_friction@cart_1": (0.306, 2.16, 1.32),
    "position_friction@cart_2": (0.437, 2.46, 1.33),
    "presliding@cart_1": (2.42, 2.81, 1.23),
    "presliding@cart_2": (0.464, 1.83, 1.36),
    "quadratic_drag@cart_1": (0.585, 3.68, 0.28),
    "quadratic_drag@cart_2": (0.241, 3.74, 0.46),
    "random_impacts@outside": (0.346, 1.54, 1.53),
    "saturation@actuator": (1.99, 3.07, 1.24),
    "slew_limit@outside": (0.388, 1.49, 1.32),
    "slipping_belt@outside": (1, 1.58, 1.24),
    "spring_damping@spring": (0.297, 3.07, 1.34),
    "spring_hysteresis@spring": (1, 2.48, 1.21),
    "stribeck@cart_1": (3, 1.43, 0.85),
    "stribeck@cart_2": (2.63, 2.45, 1.28),
    "tilt@guide": (1, 1.43, 1.43),
    "viscous_asymmetry@cart_1": (0.468, 1.52, 1.52),
    "viscous_asymmetry@cart_2": (1.6, 1.48, 1.48),
}
