"""Candidates around a drive, their gains in data and in null draws, and which of them are accepted."""
