"""The simulated rig: a drive behind the protocol of a rig, whose clock waits for its commands."""

from __future__ import annotations

from math import inf

import numpy as np

from baselines.loop_analysis.stability_limit import with_rig
from baselines.rig.protocol import Description, Limits, Reading
from flexdrive_gym import Drive
from flexdrive_gym.drive import kernels, parameters
from flexdrive_gym.drive.sample import WORK_SPACE

PERIOD_S = 1e-3
TRAVEL_MM = 400.0
# carts that coast are at rest by then
_LONGEST_COAST_S = 5.0


class SimulatedRig:
    """A drive that is sampled and driven like a rig, by the compiled step.

    Parameters
    ----------
    drive
        What it is; encoder counts and the command limit are the handout's where it has none.
    period
        Of its samples [s].
    travel
        Its own limit of travel [mm].
    returns
        Whether a run starts at rest at 0; otherwise where the carts came to rest after the last one.
    """

    def __init__(
        self, drive: Drive, *, period: float = PERIOD_S, travel: float = TRAVEL_MM, returns: bool = True
    ) -> None:
        self.drive = with_rig(drive)
        values = self.drive.values
        self.description = Description(
            name=drive.name,
            period=period,
            carts=drive.carts,
            quantum=(
                values["encoder_quantisation.encoder_1.quantum"],
                values.get("encoder_quantisation.encoder_2.quantum", 0.0),
            ),
            # whoever simulates may drive the amplifier as far as its physics goes
            limits=Limits(travel=travel, voltage=inf if returns else self.drive.voltage_limit),
            real_time=False,
            returns=returns,
            saturation=self.drive.voltage_limit,
            units=drive.units,
        )
        parameters.check_delays(values, period)
        self._substeps = parameters.substeps(values, period, PERIOD_S)
        self._memory, self._z, self._p = np.zeros(WORK_SPACE), parameters.workspace(values), self.drive.vector()
        self._state, self._reading = np.zeros(4), np.empty(4)
        self._running = False
        self.output = 0.0

    def start(self, watchdog: float) -> None:
        """Begin a run; nobody is waited for, so there is nothing to watch."""
        del watchdog
        self.stop()
        if self.description.returns:
            self._state[:] = 0.0
        kernels.begin(
            self._state, self.description.period, self._substeps, self._memory, self._z, self._p, self._reading
        )
        self._sequence = -1
        self._running = True

    def read(self, timeout: float = 0.0) -> Reading:
        """Advance by one period under the command; the first sample of a run is that at its start."""
        del timeout
        period = self.description.period
        if self._sequence >= 0:
            self._advance(self.output)
        self._sequence += 1
        x1, x2, v1, v2 = self._reading.tolist()
        return Reading(self._sequence, self._sequence * period, x1, x2, self.output, v1, v2)

    def _advance(self, u: float) -> None:
        period = self.description.period
        t = self._sequence * period
        kernels.run_sample(
            self._state, u, t, period, self._substeps, self._memory, self._z, self._p, self._reading
        )  # fmt: skip

    def write(self, u: float) -> None:
        """Put out a command [V]."""
        self.output = u

    def stop(self) -> None:
        """Put out 0 V; the carts coast to rest."""
        self.output = 0.0
        if self._running and not self.description.returns:
            for _ in range(round(_LONGEST_COAST_S / self.description.period)):
                if not self._state[1::2].any():
                    break
                self._advance(0.0)
                self._sequence += 1
        self._running = False

    def close(self) -> None:
        """Stop."""
        self.stop()
