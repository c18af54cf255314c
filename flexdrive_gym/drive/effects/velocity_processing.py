"""How velocity is made from encoder positions: raw backward difference, or a filtered derivative.

With cut-off f and a = exp(-2πf·Ts) the filtered derivative is ``v[n] = a·v[n-1] + (1 - a)·(x[n] - x[n-1])/Ts``, the
backward difference through a first-order low-pass of unit gain. At the null value f = 0 the filter is absent: the
raw backward difference, which is what the handout's rig records.
"""

from __future__ import annotations

from flexdrive_gym.drive.effects._effect import Effect, Parameter

EFFECT = Effect(
    id="velocity_processing",
    where=("encoder_1", "encoder_2"),
    equation="v[n] = a·v[n-1] + (1 - a)·(x[n] - x[n-1])/Ts,  a = exp(-2π·cutoff·Ts); raw difference at cutoff = 0",
    parameters=(Parameter("cutoff", "Hz", 0.0, 0.0, 1e5, "cut-off of the derivative filter", (50.0,), role="shape"),),
    tells_itself_by="smooth velocities that lag the raw difference of the positions",
    looks_like=("encoder_delay",),
    separating_experiment="record position and velocity together",
    reference="raw difference on the handout's rig",
    base=True,
)
