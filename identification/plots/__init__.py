"""Figures of the handout's report (3.5) and of a diagnosis; each function takes data and returns a matplotlib Figure."""

from identification.plots.bode import plot_bode, plot_pole_zero
from identification.plots.mismatch import plot_before_after, plot_curve, plot_maps, plot_telling_map
from identification.plots.runs import caption_of_sines, plot_recording, plot_sines, plot_validation
from identification.plots.steps import (
    plot_damped_frequency,
    plot_steady_state,
    plot_time_constant,
    plot_zeta_iteration,
)

__all__ = [
    "caption_of_sines",
    "plot_before_after",
    "plot_bode",
    "plot_curve",
    "plot_damped_frequency",
    "plot_maps",
    "plot_pole_zero",
    "plot_recording",
    "plot_sines",
    "plot_steady_state",
    "plot_telling_map",
    "plot_time_constant",
    "plot_validation",
    "plot_zeta_iteration",
]
