"""Tests of reading, checking and recognising recordings and of finding their faults."""
