"""The handout's report as one HTML page."""

from baselines.report.build import STEPS, build_report

__all__ = ["STEPS", "build_report"]
