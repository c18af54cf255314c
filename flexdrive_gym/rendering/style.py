"""Colours of the pictures: those of the printed figures."""

CART = {1: "#1f5a99", 2: "#d9660f"}
COMMAND = "#333333"
REFERENCE = "#808080"
LIMIT = "#b3202c"
TEXT = "#333333"
QUIET = "#6b6b6b"
GRID = "#dddddd"
RAIL = "#9a9a9a"
SPRING = "#555555"
PAPER = "#ffffff"
