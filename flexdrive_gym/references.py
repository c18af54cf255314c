"""Reference trajectories and excitations of the laboratory, and the names by which they are asked for.

Each function takes instants t [s] and returns values at them, so any sample time will do. :data:`REFERENCES` lists
them by name; :func:`sample_reference` turns whatever a user calls a reference (a name, a name with keywords, an array,
a function) into one value per sample.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from flexdrive_gym import reference_specs
from flexdrive_gym.recording import FloatArray
from flexdrive_gym.reference_specs import ReferenceKind, ReferenceParameter, ReferenceSpec

# the handout's move: 50 mm at 100 mm/s and 500 mm/s², forward at 0 s, back at 1 s, every 2 s
STROKE_MM = 50.0
SPEED_MM_S = 100.0
ACCELERATION_MM_S2 = 500.0
DWELL_UNTIL_S = 1.0
PERIOD_S = 2.0

# round-off that may not move an edge to the next sample
EDGE = 1e-9


def point_to_point(
    t: npt.ArrayLike,
    stroke: float = STROKE_MM,
    speed: float = SPEED_MM_S,
    acceleration: float = ACCELERATION_MM_S2,
) -> FloatArray:
    """Return a move from 0 to ``stroke`` with a trapezoidal velocity, then held.

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s]; the move starts at 0.
    stroke, speed, acceleration
        Length [mm], cruising speed [mm/s] and acceleration [mm/s²]; the speed is not reached if the stroke is short.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    times = np.asarray(t, dtype=np.float64)
    peak = min(speed, float(np.sqrt(stroke * acceleration)))
    ramp = peak / acceleration
    total = stroke / peak + ramp
    rising = np.clip(times, 0.0, ramp)
    cruise = np.clip(times - ramp, 0.0, total - 2.0 * ramp)
    falling = np.clip(times - (total - ramp), 0.0, ramp)
    return np.asarray(0.5 * acceleration * rising**2 + peak * cruise + peak * falling - 0.5 * acceleration * falling**2)


def handout_trajectory(t: npt.ArrayLike) -> FloatArray:
    """Return the trajectory of labs 3 and 4: 50 mm forth and back with dwells, repeating every 2 s [mm]."""
    phase = np.mod(np.asarray(t, dtype=np.float64), PERIOD_S)
    return np.asarray(point_to_point(phase) - point_to_point(phase - DWELL_UNTIL_S))


def square(t: npt.ArrayLike, amplitude: float, frequency: float) -> FloatArray:
    """Return a square wave ±amplitude that starts with its positive half period."""
    # a sample that falls on an edge belongs to the half period that begins there, whatever round-off says
    phase = np.mod(np.asarray(t, dtype=np.float64) * frequency + 1e-9, 1.0)
    return np.where(phase < 0.5, amplitude, -amplitude)


def sine(t: npt.ArrayLike, amplitude: float, frequency: float) -> FloatArray:
    """Return amplitude·sin(2π·frequency·t)."""
    return np.asarray(amplitude * np.sin(2.0 * np.pi * frequency * np.asarray(t, dtype=np.float64)))


def step(t: npt.ArrayLike, amplitude: float = STROKE_MM, at: float = 0.2) -> FloatArray:
    """Return 0 before the instant ``at`` [s] and ``amplitude`` [mm] from then on."""
    return np.where(np.asarray(t, dtype=np.float64) >= at - EDGE, float(amplitude), 0.0)


def chirp(t: npt.ArrayLike, amplitude: float, start_hz: float, end_hz: float, duration: float) -> FloatArray:
    """Return a sine whose frequency changes linearly, then stays; it starts at 0 and its phase never jumps.

    The phase is the integral of the frequency, 2π·(start_hz·t + (end_hz - start_hz)·t²/(2·duration)).

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s]; 0 before 0.
    amplitude
        [mm].
    start_hz, end_hz
        Frequency at 0 and from ``duration`` on [Hz].
    duration
        Of the change [s].

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    _check_positive(duration=duration)
    times = np.maximum(np.asarray(t, dtype=np.float64), 0.0)
    sweeping = np.minimum(times, duration)
    cycles = start_hz * sweeping + (end_hz - start_hz) * sweeping**2 / (2.0 * duration) + end_hz * (times - sweeping)
    return np.asarray(amplitude * np.sin(2.0 * np.pi * cycles))


def s_curve(
    t: npt.ArrayLike,
    stroke: float = STROKE_MM,
    speed: float = SPEED_MM_S,
    acceleration: float = ACCELERATION_MM_S2,
    jerk: float = 5000.0,
) -> FloatArray:
    """Return a move from 0 to ``stroke`` in seven segments of constant jerk, then held.

    With jerk J held for τj, acceleration J·τj for τa and speed V = J·τj·(τj + τa) for τv, the move is
    V·(2τj + τa + τv) long. Each of τj and τa is the longest that no limit and not the stroke itself forbids, so the
    move is the fastest one within the limits (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines
    and Robots, 2008, 3.4).

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s]; the move starts at 0.
    stroke
        Length with its sign [mm].
    speed, acceleration, jerk
        Limits [mm/s, mm/s², mm/s³]; a short stroke reaches only some of them.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    _check_positive(speed=speed, acceleration=acceleration, jerk=jerk)
    times, length = np.asarray(t, dtype=np.float64), abs(stroke)
    if length == 0.0:
        return np.zeros_like(times)
    tj = float(min(acceleration / jerk, np.sqrt(speed / jerk), np.cbrt(length / (2.0 * jerk))))
    # τa that reaches the speed, and τa that covers the stroke without cruising
    for_speed = speed / (jerk * tj) - tj
    for_stroke = 0.5 * (np.sqrt(tj**2 + 4.0 * length / (jerk * tj)) - 3.0 * tj)
    ta = max(min(for_speed, float(for_stroke)), 0.0)
    peak = jerk * tj * (tj + ta)
    rise = 2.0 * tj + ta
    total = max(length / peak, rise) + rise

    # the move is symmetric about its middle; mirroring the first half makes the end exact
    early = np.clip(np.minimum(times, total - times), 0.0, None)
    rising = np.minimum(early, rise)
    cubes = sum(
        sign * np.maximum(rising - begin, 0.0) ** 3
        for sign, begin in ((1.0, 0.0), (-1.0, tj), (-1.0, tj + ta), (1.0, rise))
    )
    covered = jerk / 6.0 * cubes + peak * np.maximum(early - rise, 0.0)
    return np.asarray(np.sign(stroke) * np.where(times > 0.5 * total, length - covered, covered))


def prbs(t: npt.ArrayLike, amplitude: float, bit_s: float, rng: np.random.Generator) -> FloatArray:
    """Return a random binary sequence: ±amplitude, drawn anew every ``bit_s`` and held.

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s]; the first bit starts at 0.
    amplitude
        [mm].
    bit_s
        Length of a bit [s].
    rng
        Source of the bits; the same state gives the same sequence whatever the sample time.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    _check_positive(bit_s=bit_s)
    # a sample that falls on an edge belongs to the bit that begins there
    bit = np.maximum(np.floor(np.asarray(t, dtype=np.float64) / bit_s + EDGE), 0.0).astype(np.int64)
    bits = rng.integers(0, 2, size=int(bit.max(initial=0)) + 1)
    return np.where(bits[bit] == 1, float(amplitude), -float(amplitude))


def random_moves(
    t: npt.ArrayLike,
    rng: np.random.Generator,
    stroke: float = STROKE_MM,
    speed: float = SPEED_MM_S,
    acceleration: float = ACCELERATION_MM_S2,
    dwell_s: float = 0.4,
) -> FloatArray:
    """Return point-to-point moves to random targets, each with a trapezoidal velocity and a dwell after it.

    Parameters
    ----------
    t : array_like, shape (n,)
        Instants [s], rising; the first move starts at 0 from position 0.
    rng
        Source of the targets, uniform from -stroke to +stroke; the same state gives the same moves whatever the
        sample time.
    stroke
        Largest distance of a target from 0 [mm].
    speed, acceleration
        Limits [mm/s, mm/s²].
    dwell_s
        Rest at each target [s].

    Returns
    -------
    ndarray, shape (n,)
        Position [mm].
    """
    _check_positive(stroke=stroke, speed=speed, acceleration=acceleration)
    if not dwell_s >= 0.0:
        raise ValueError(f"dwell_s: must not be negative [s]; got {dwell_s:g}. Use 0 for moves without rest.")
    times = np.asarray(t, dtype=np.float64)
    values = np.zeros_like(times)
    begin, position = 0.0, 0.0
    while begin <= times.max(initial=0.0):
        move = rng.uniform(-stroke, stroke) - position
        length = abs(move)
        peak = min(speed, float(np.sqrt(length * acceleration)))
        end = begin + length / peak + peak / acceleration + dwell_s
        inside = slice(*np.searchsorted(times, (begin, end)))
        values[inside] = position + np.sign(move) * point_to_point(times[inside] - begin, length, speed, acceleration)
        begin, position = end, position + move
    return values


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < np.inf:
            raise ValueError(f"{name}: must be positive and finite; got {value:g}. Pass a value above 0.")


_SPEED = ReferenceParameter("speed", SPEED_MM_S, "mm/s", "largest speed")
_ACCELERATION = ReferenceParameter("acceleration", ACCELERATION_MM_S2, "mm/s²", "largest acceleration")

REFERENCES: Mapping[str, ReferenceKind] = {
    "handout": ReferenceKind(handout_trajectory, "the move of labs 3 and 4: 50 mm forth and back every 2 s"),
    "step": ReferenceKind(
        step,
        "one step",
        (
            ReferenceParameter("amplitude", STROKE_MM, "mm", "height of the step"),
            ReferenceParameter("at", 0.2, "s", "instant of the step"),
        ),
    ),
    "square": ReferenceKind(
        square,
        "square wave, positive half period first",
        (
            ReferenceParameter("amplitude", 25.0, "mm", "half of the peak-to-peak height"),
            ReferenceParameter("frequency", 0.5, "Hz", "repetitions per second"),
        ),
    ),
    "sine": ReferenceKind(
        sine,
        "sine from 0",
        (
            ReferenceParameter("amplitude", 25.0, "mm", "half of the peak-to-peak height"),
            ReferenceParameter("frequency", 0.5, "Hz", "cycles per second"),
        ),
    ),
    "chirp": ReferenceKind(
        chirp,
        "sine of linearly changing frequency",
        (
            ReferenceParameter("amplitude", 10.0, "mm", "half of the peak-to-peak height"),
            ReferenceParameter("start_hz", 0.1, "Hz", "frequency at the start"),
            ReferenceParameter("end_hz", 5.0, "Hz", "frequency at the end, held from then on"),
            ReferenceParameter("duration", 10.0, "s", "time over which the frequency changes"),
        ),
    ),
    "s_curve": ReferenceKind(
        s_curve,
        "one move with limited jerk, then held",
        (
            ReferenceParameter("stroke", STROKE_MM, "mm", "length of the move"),
            _SPEED,
            _ACCELERATION,
            ReferenceParameter("jerk", 5000.0, "mm/s³", "largest jerk"),
        ),
    ),
    "prbs": ReferenceKind(
        prbs,
        "random binary sequence of held bits",
        (
            ReferenceParameter("amplitude", 20.0, "mm", "half of the peak-to-peak height"),
            ReferenceParameter("bit_s", 0.5, "s", "length of a bit"),
        ),
        needs_rng=True,
    ),
    "random_moves": ReferenceKind(
        random_moves,
        "point-to-point moves to random targets with dwells",
        (
            ReferenceParameter("stroke", STROKE_MM, "mm", "largest distance of a target from 0"),
            _SPEED,
            _ACCELERATION,
            ReferenceParameter("dwell_s", 0.4, "s", "rest at each target"),
        ),
        needs_rng=True,
    ),
}


def sample_reference(spec: ReferenceSpec, t: npt.ArrayLike, rng: np.random.Generator | None = None) -> FloatArray:
    """Return the reference at given instants.

    Parameters
    ----------
    spec
        One of

        * a name in :data:`REFERENCES`, with its default keywords, or ``"name:keyword=value:…"``;
        * a tuple (name, {keyword: value});
        * an array of positions [mm], shape (m,), one per sample; its last value is held when m < n;
        * a function f(t) or f(t, rng) of all instants at once that returns ndarray, shape (n,) [mm].
    t : array_like, shape (n,)
        Instants [s].
    rng
        Source of randomness; only a random reference (see :func:`is_random`) draws from it.

    Returns
    -------
    ndarray, shape (n,)
        Position [mm], a new array.

    Raises
    ------
    TypeError, ValueError
        If ``spec`` is none of these, with the rule, the value and a remedy; if ``rng`` is missing.
    """
    return reference_specs.sample(spec, REFERENCES, np.asarray(t, dtype=np.float64), rng)


def is_random(spec: ReferenceSpec) -> bool:
    """Return whether a reference draws random numbers, so that another seed gives another reference.

    A function counts as random if it has a parameter ``rng`` or a second one without default.
    """
    return reference_specs.is_random(spec, REFERENCES)
