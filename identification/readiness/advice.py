"""What is missing in a set of recordings, and the experiment that mends it (handout 2.5 and 2.6)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from flexdrive_gym.recording import Recording
from flexdrive_gym.units import Units
from identification.experiment import experiment_of, position
from identification.readiness.identifiability import Identifiability

# sines count as around the resonance between half and twice of it
_AROUND = 2.0
_FROM_SCRATCH = (
    "Record the drive with both carts free: square waves at two amplitudes (handout 2.5) and sines around its "
    "resonance (2.6)."
)
_FEWEST_SINES, _FEWEST_AMPLITUDES, _FEWEST_REPLICATES = 3, 2, 2


def advice(usable: Sequence[Recording], found: Identifiability | None, units: Units) -> tuple[str, ...]:
    """Return one sentence for each lack, most important first.

    Parameters
    ----------
    usable
        Recordings that a fit can use.
    found
        What they determine, or ``None`` where nothing could be fitted.
    units
        The rig's.
    """
    if not usable:
        return (_FROM_SCRATCH,)
    lines = [
        _reversals(usable),
        _amplitudes(usable, units),
        _frequencies(usable, found, units),
        _replicates(usable, units),
    ]
    lines.append(_loops(usable))
    return tuple(line for line in lines if line)


def _level(usable: Sequence[Recording]) -> float:
    return float(np.median([np.max(np.abs(r.u)) for r in usable]))


def _volts(value: float, units: Units) -> str:
    return f"±{units.text(value, 'V', 2)}"


def _reversals(usable: Sequence[Recording]) -> str:
    for r in usable:
        x = position(r, 1)
        if x is None:
            x = position(r, 2)
        if x is None:
            continue
        up, down = float(np.max(np.maximum.accumulate(-x) + x)), float(np.max(np.maximum.accumulate(x) - x))
        if min(up, down) > 0.05 * max(up, down) > 0.0:
            return ""
    return (
        "No run moves both ways: dry friction cannot be told from a constant force. Record a square wave that "
        "reverses the carts "
        "(handout 2.5)."
    )


def _amplitudes(usable: Sequence[Recording], units: Units) -> str:
    squares = [r for r in usable if r.excitation.kind == "square"]
    levels = sorted({round(r.excitation.amplitude, 2) for r in squares})
    others = [r for r in usable if experiment_of(r) in ("step", "ramp", "other")]
    if len(levels) >= _FEWEST_AMPLITUDES or (
        others and len({round(float(np.max(np.abs(r.u))), 2) for r in others}) > 1
    ):
        return ""
    if any(r.closed_loop for r in usable) and len(squares) == 0:
        return ""
    top = max(levels) if levels else _level(usable)
    less, much = _volts(0.75 * top, units), _volts(top, units)
    if levels:
        return (
            f"Square waves at one amplitude only, {much}: a second one, such as {less}, tells viscous friction from dry friction "
            "(handout 2.5)."
        )
    return (
        f"No square waves: record them at two amplitudes, such as {less} and {much} at 0.5 Hz, to tell viscous friction from dry "
        "friction (handout 2.5)."
    )


def _frequencies(usable: Sequence[Recording], found: Identifiability | None, units: Units) -> str:
    if found is None or found.fit.drive.carts == 1 or any(r.closed_loop for r in usable):
        return ""
    if found.half_width and max((w for n, w in found.half_width.items() if n in ("m1", "m2", "k")), default=0.0) < 0.1:
        return ""
    resonance = found.fit.drive.linear.omega_n / (2.0 * np.pi)
    if not np.isfinite(resonance) or resonance <= 0.0:
        return ""
    sines = {round(r.excitation.frequency, 2) for r in usable if r.excitation.kind == "sine"}
    near = [f for f in sines if resonance / _AROUND <= f <= resonance * _AROUND]
    if len(near) >= _FEWEST_SINES:
        return ""
    had = f"{len(near)} sine{'' if len(near) == 1 else 's'}" if near else "No sine"
    wanted = [units.of_rig(f * resonance, "Hz")[0] for f in (0.6, 0.8, 1.0, 1.25, 1.6)]
    listed = ", ".join(f"{f:.2g}" for f in wanted)
    size = _volts(_level(usable), units)
    return (
        f"{had} around the resonance at {units.text(resonance, 'Hz', 2)}: sines of {size} at {listed} Hz tell the masses and the "
        "spring apart (handout 2.6)."
    )


def _replicates(usable: Sequence[Recording], units: Units) -> str:
    del units
    keys = Counter(
        (
            experiment_of(r),
            float(f"{r.excitation.amplitude or np.max(np.abs(r.u)):.2g}"),
            float(f"{r.excitation.frequency:.3g}"),
            r.excitation.gain and float(f"{r.excitation.gain:.2g}"),
        )
        for r in usable
    )
    if max(keys.values()) >= _FEWEST_REPLICATES:
        return ""
    return (
        "No run was repeated: record one of them three times without touching the rig; only replicates tell "
        "what no model can explain "
        "(handout 2.5)."
    )


def _loops(usable: Sequence[Recording]) -> str:
    if all(r.closed_loop for r in usable):
        return (
            "Closed-loop runs only: their command is replayed, which drifts with friction. Open the loop for "
            "square waves and sines "
            "(handout 2.5, 2.6); where it cannot be opened, move both ways at several speeds."
        )
    return ""
