"""A pure delay between command and force.

The step's driver holds past commands; a delay that is not a whole number of samples splits the sample into two
pieces, so any delay is exact under the zero-order hold.
"""

from __future__ import annotations

from flexdrive_gym.drive.effects._effect import Effect, Parameter

EFFECT = Effect(
    id="input_delay",
    where=("actuator",),
    equation="u ← u(t - τ)",
    parameters=(Parameter("tau", "s", 0.0, 0.0, 0.03, "delay", (0.002,)),),
    tells_itself_by="phase proportional to frequency",
    looks_like=("amplifier_lag",),
    separating_experiment="a 20-40 Hz sine or a fast step",
    reference="physics catalogue",
    base=True,
)
