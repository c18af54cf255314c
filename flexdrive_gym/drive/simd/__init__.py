"""Several recordings of one drive in the lanes of a vector."""
