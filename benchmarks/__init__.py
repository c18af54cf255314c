"""Measurements run by hand or by ``make bench``: accuracy, speed, coverage of the intervals."""
