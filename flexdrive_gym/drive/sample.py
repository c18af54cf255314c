"""One control sample: delay of the command, steps of the physics, encoders and the velocities made from them."""

from __future__ import annotations

from math import exp, pi
from typing import Any

from flexdrive_gym.drive.compilation import inlined
from flexdrive_gym.drive.effects import (
    ANCHOR_1,
    ANCHOR_2,
    LAYOUT,
    N_BASE_PARAMETERS,
    PUSH_1,
    PUSH_2,
    RING,
    prepare,
)
from flexdrive_gym.drive.forces import begin_effects, commanded, rate_1, rate_2, readings
from flexdrive_gym.drive.piece import TABLE
from flexdrive_gym.drive.simd.pack import chosen, leading

# memory of one drive between samples: previous readings, filtered velocities, position in and ring of past commands
MEMORY = 5 + RING
_PREVIOUS_1, _PREVIOUS_2, _FILTERED_1, _FILTERED_2, _HEAD, _COMMANDS = 0, 1, 2, 3, 4, 5
# what a kernel's caller provides: the memory, then the table of the step and a parameter vector to make it with
WORK_SPACE = MEMORY + TABLE + N_BASE_PARAMETERS

DELAY = LAYOUT["input_delay.tau"].index
CUTOFF_1 = LAYOUT["velocity_processing.encoder_1.cutoff"].index
CUTOFF_2 = LAYOUT["velocity_processing.encoder_2.cutoff"].index


@inlined
def advance(
    step: Any,
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    command: float,
    t: float,
    sample_time: float,
    substeps: int,
    table: Any,
    memory: Any,
    z: Any,
    p: Any,
) -> tuple[float, float, float, float]:
    """Advance the drive by one control sample under a held command; return x1, v1, x2, v2.

    ``step`` is that of one drive or, given packs, of recordings in lanes. An input delay of whole samples plus a remainder
    makes the sample two pieces: the older command acts for the remainder, the newer one for the rest.
    """
    u = commanded(command, t, z, p)
    delay = p[DELAY]
    if delay == 0.0:
        h = sample_time / substeps
        for i in range(substeps):
            x1, v1, x2, v2 = step(x1, v1, x2, v2, u, t + i * h, h, table, z, p)
        return x1, v1, x2, v2

    head = (int(leading(memory[_HEAD])) + 1) % RING
    memory[_HEAD] = head
    memory[_COMMANDS + head] = u
    # a delay that is whole up to round-off is whole
    whole = int(delay / sample_time + 1e-9)
    part = max(delay - whole * sample_time, 0.0)
    older = memory[_COMMANDS + (head - whole - 1) % RING]
    newer = memory[_COMMANDS + (head - whole) % RING]
    h = part / substeps
    if part > 0.0:
        for i in range(substeps):
            x1, v1, x2, v2 = step(x1, v1, x2, v2, older, t + i * h, h, table, z, p)
    h = (sample_time - part) / substeps
    for i in range(substeps):
        x1, v1, x2, v2 = step(x1, v1, x2, v2, newer, t + part + i * h, h, table, z, p)
    return x1, v1, x2, v2


@inlined
def decay(cutoff: float, sample_time: float) -> float:
    """Return the share a of its past that the velocity filter keeps per sample; 0 for the raw difference."""
    return exp(-2.0 * pi * cutoff * sample_time) if cutoff > 0.0 else 0.0


@inlined
def velocity(raw: float, filtered: float, a: float) -> float:
    """Return the velocity made from the rate of the readings and its own past [mm/s]."""
    return a * filtered + (1.0 - a) * raw


@inlined
def measure(
    x1: float, v1: float, x2: float, v2: float, t: float, sample_time: float, memory: Any, z: Any, p: Any
) -> tuple[float, float, float, float]:
    """Return what the encoders report: positions [mm] and the velocities made from them [mm/s]."""
    r1, r2 = readings(x1, v1, x2, v2, t, sample_time, z, p)
    raw_1 = rate_1((r1 - memory[_PREVIOUS_1]) / sample_time, z, p)
    raw_2 = rate_2((r2 - memory[_PREVIOUS_2]) / sample_time, z, p)
    q1 = velocity(raw_1, memory[_FILTERED_1], decay(p[CUTOFF_1], sample_time))
    q2 = velocity(raw_2, memory[_FILTERED_2], decay(p[CUTOFF_2], sample_time))
    memory[_PREVIOUS_1], memory[_PREVIOUS_2] = r1, r2
    memory[_FILTERED_1], memory[_FILTERED_2] = q1, q2
    return r1, r2, q1, q2


@inlined
def clear(v1: float, v2: float, memory: Any, z: Any, p: Any) -> None:
    """Clear what one drive remembers that starts at these velocities; before the start its command was 0 V."""
    for i in range(MEMORY):
        memory[i] = 0.0
    if z is not None:
        prepare(z, p)
        rest = commanded(0.0, 0.0, z, p)
        for i in range(RING):
            memory[_COMMANDS + i] = rest
        begin_effects(v1, v2, rest, z, p)


@inlined
def anchor(track_1: float, track_2: float, x1: float, x2: float, z: Any) -> None:
    """Tell the effects of position where the rig's carts were; not a number where that is unknown."""
    if z is not None:
        # nothing that is not a number equals itself
        z[ANCHOR_1] = chosen(track_1 == track_1, track_1 - x1, z[ANCHOR_1])  # noqa: PLR0124
        z[ANCHOR_2] = chosen(track_2 == track_2, track_2 - x2, z[ANCHOR_2])  # noqa: PLR0124


@inlined
def push(force_1: float, force_2: float, z: Any) -> None:
    """Let additional forces [V] act on the carts until the next sample."""
    if z is not None:
        z[PUSH_1], z[PUSH_2] = force_1, force_2


@inlined
def power_up(
    x1: float, v1: float, x2: float, v2: float, sample_time: float, memory: Any, z: Any, p: Any
) -> tuple[float, float, float, float]:
    """Return the first readings of one drive that starts in the given state, after :func:`clear`."""
    r1, r2 = readings(x1, v1, x2, v2, 0.0, sample_time, z, p)
    q1, q2 = rate_1(v1, z, p), rate_2(v2, z, p)
    memory[_PREVIOUS_1], memory[_PREVIOUS_2] = r1, r2
    memory[_FILTERED_1], memory[_FILTERED_2] = q1, q2
    return r1, r2, q1, q2
