"""The physics of the drive: numpy and numba only."""
