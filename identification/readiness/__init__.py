"""Are recordings ready for a fit? What they are, which sessions they belong to, and what they can identify."""

from identification.readiness.check import check
from identification.readiness.report import Check

__all__ = ["Check", "check"]
