"""Many drives in one compiled call."""
