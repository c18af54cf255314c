"""What could be missing: the catalogue's effects, and forces as free functions of what was measured."""
