"""Reinforcement learning on the drive; the only place that imports torch and Stable-Baselines3 (``agents`` needs neither)."""
