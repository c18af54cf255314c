"""What figures of a drive are called for people."""

from baselines.lab.experiments import STABLE_GAIN
from flexdrive_gym.references import STROKE_MM
from flexdrive_gym.units import LAB, Units


def prediction_name(name: str, units: Units = LAB) -> str:
    """Return a prediction's name in words."""
    gain = units.text(STABLE_GAIN, "V/mm")
    if name == "steady_error":
        return f"error after a step of {units.text(STROKE_MM, 'mm')} at Kp = {gain}"
    for feedback in ("x1", "x2"):
        name = name.replace(f"critical_gain_{feedback}_", f"critical gain from {feedback}, ")
        name = name.replace(f"phase_margin_{feedback}", f"phase margin from {feedback} at Kp = {gain}")
    return {"resonance_hz": "resonance frequency", "damping_ratio": "damping ratio"}.get(name, name).replace(
        "trajectory", "lab's trajectory"
    )
