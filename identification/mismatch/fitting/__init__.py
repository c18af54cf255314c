"""Recordings as experiments, residuals of a drive to them, fits, and what a fit gains for experiments it did not see."""
