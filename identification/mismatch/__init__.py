"""When recordings and drive differ: locate the mismatch, name what was left out, model it, prove it."""
