"""Every constant of the diagnosis, with its unit, default and derivation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Constants of the diagnosis; none belongs to a single effect or rig.

    Attributes
    ----------
    window_s
        Length of the test functions of the weak form [s]. A drive's resonance lies at a few hertz; 60 ms keeps what is slower
        than about 20 Hz and averages encoder counts.
    hop_s
        Distance of neighbouring test functions [s]: a quarter of their length, so that nothing falls between two.
    smoothing_s
        Standard deviation of the Gaussian that velocities pass inside non-linear terms [s]; a tenth of a test function.
    along_s
        Step along the measured motion when an effect's force is taken from the drive's own step [s]: a twentieth of a test
        function.
    reversal
        Share of a recording's rms velocity under which a cart counts as near a reversal or at rest. Coulomb friction there is
        any force within its level, so the equation is not known.
    model_error
        Share of the signal's variance that a model of a drive is expected to miss where nothing else is known [1]. It only
        sets the weights of the first fit; afterwards each recording's own residual does.
    own_share
        Weight of a recording's own residual variance against that expected from its signal [1]. Variances wholly free reward a
        wrong model for fitting few quiet recordings exactly; variances wholly expected ignore a noisy one.
    proposals
        Candidates fitted per round, those whose linear changes are the least like chance, and half as many by each screen of the
        equation error.
    likely
        P-value of a linear change up to which a candidate that was not proposed is fitted, too, before another is named.
    finished
        Candidates per round whose fits are carried to the end; the others are left after a few steps, for none of them came
        within half of the best one's gain on development data.
    large
        Share of the squared error that a candidate explains, from which on it brings a simulation near that was far [1].
    again
        Log-likelihood that a fit gains, from which on the noise is estimated again around it: unknown forces take over what a
        model lacks, and hide it. Best fits to data that lack nothing gain about 10.
    ripple
        Log-likelihood that a ripple with a phase of its own in every run gains, from which on the noise is told beside it: the
        best of a grid of periods gains a few units where there is none.
    far
        Share of the signal's variance that a simulation misses, beyond which the equation error proposes candidates, too [1].
    draws
        Null draws: 480 resolve p = 0.002, and half of them are enough where no draw reaches what was found, and for the limits
        that hold 95 % of simulated estimates.
    few
        Recordings under which sign flips are too few and Webb's six-point weights are used: 2^(12 - 1) = 2048 flips.
    rows
        Rows of a data set beyond which each is twice as long: half as many again as the 40,000 of a day of 20 recordings, of
        which 13 of 8 s estimate. Time goes with their number.
    rounds
        Largest number of effects: five fill the tables of a report, and no development data set has more than two.
    relevant
        Share of the squared output error that a finding beside another, or a ripple, takes off at least [1]. Neighbouring rows of
        5 ms correlate by 0.97, so that 600 of the 40,000 of a data set are independent: of a hundred parameters that are fitted
        to nothing one takes off more. Friction that differs from run to run lasts longer, so recordings that are left out must
        gain, too, and of a first finding no more is asked.
    relevant_deflection
        The same of the deflection [1], whose error lasts until a cart moves on: a data set has a hundred independent ones, of
        which the best of a hundred parameters that are fitted to nothing takes off 2 ln(100) / 100.
    inexact
        Share of what names have gained that a further one must gain [1], or of the squared output error that they took off; or it
        takes ``large`` off what is left. No law is exact, and a fourteenth of the force of what was named is no second effect. A
        gain goes with the square of a force, and so does the squared error, of which an independent program's data sets left up
        to 0.43 % to seven wrong names, and right ones took 1.2 % and more (``python -m benchmarks later_names``, seeds 24 to 27).
    one_size
        Share of the square of its size by which an effect may differ between experiments [1], a tenth of the size: dry friction
        differs by 6 % between runs, 4 % within and 2.6 % along the track of two recorded rigs, and no law is exact
        (0.06² + 0.04² + 0.026² + ``inexact``).
    small_motion
        Rms velocity over the noise that encoder counts make in a block, under which positions are compared instead [1]: there
        a difference of counts is mostly rounding, and the counts themselves are not.
    damping
        Ridge of leave-one-out steps relative to the diagonal of the information [1]: far below the share that one recording has
        in any parameter, far above round-off.
    iterations
        Most Gauss-Newton steps of a fit: so many that a fit ends where steps no longer help.
    tolerance
        Relative decrease of the squared error that ends a fit [1]; a tenth of a unit of log-likelihood in 20,000 rows.
    """

    window_s: float = 0.06
    hop_s: float = 0.015
    smoothing_s: float = 0.006
    along_s: float = 0.003
    reversal: float = 0.15
    model_error: float = 0.02
    own_share: float = 0.5
    proposals: int = 8
    likely: float = 0.2
    finished: int = 6
    large: float = 0.2
    again: float = 20.0
    ripple: float = 10.0
    far: float = 0.05
    draws: int = 480
    few: int = 12
    rows: int = 60_000
    rounds: int = 5
    relevant: float = 0.01
    relevant_deflection: float = 0.1
    inexact: float = 0.005
    one_size: float = 0.01
    small_motion: float = 1.0
    damping: float = 1e-6
    iterations: int = 200
    tolerance: float = 1e-5
