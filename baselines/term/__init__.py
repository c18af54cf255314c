"""A term at a glance: every group's hand-in checked, identified and diagnosed, and what stands out among them."""
