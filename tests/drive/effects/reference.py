"""An independent integration of the drive with left-out physics: scipy's DOP853, one right-hand side per stick-slip mode.

Nothing of the package is used. A drive is a set of plain functions, written down once more from the literature; states of its
own (a bristle, an appendage, a lag) are integrated in time as their differential equations say.
"""

import numpy as np
from scipy.integrate import solve_ivp


def nothing(*_arguments):
    return 0.0


class Masses:
    """``y`` is x1, v1, x2, v2 and then the additional states ``w``.

    spring(δ, dδ/dt, w), on_1(t, y, s), on_2(t, y, s), level_1(t, y, s, Fs) and so on; command(u, w), rates(t, y, u) -> list.
    """

    def __init__(self, rig, *, spring=None, on_1=nothing, on_2=nothing, level_1=None, level_2=None, extra_1=0.0,
                 extra_2=0.0, command=None, rates=None, extra_start=()):  # fmt: skip
        self.m = rig["m1"], rig["m2"]
        self.b = rig["b1"], rig["b2"]
        self.spring = spring or (lambda delta, _rate, _w: rig["k"] * delta)
        self.on = on_1, on_2
        self.level = (
            level_1 or (lambda _t, _y, _s, _fs: rig["d1"]),
            level_2 or (lambda _t, _y, _s, _fs: rig["d2"]),
        )
        self.extra = extra_1, extra_2
        self.command = command or (lambda u, _w, _y: u)
        self.rates = rates or (lambda _t, _y, _u: [])
        self.extra_start = list(extra_start)

    def forces(self, t, y, u, s):
        fs = self.spring(y[0] - y[2], y[1] - y[3], y[4:])
        f1 = self.command(u, y[4:], y) - fs - self.b[0] * y[1] + self.on[0](t, y, s[0])
        f2 = fs - self.b[1] * y[3] + self.on[1](t, y, s[1])
        return (f1, f2), fs

    def over(self, cart, t, y, u):
        """By how much a cart at rest is pulled over what it holds, and where to."""
        force, fs = self.forces(t, y, u, (0.0, 0.0))
        s = 1.0 if force[cart] > 0.0 else -1.0
        return force[cart] * s - self.level[cart](t, y, s, fs) - self.extra[cart], s

    def interval(self, a, b, y, u):
        released = [0.0, 0.0]
        for _ in range(200):
            s = []
            for cart in (0, 1):
                v = y[1 + 2 * cart]
                over, sign = self.over(cart, a, y, u)
                s.append(np.sign(v) if v != 0.0 else released[cart] or (sign if over > 1e-12 else 0.0))
            events = []
            for cart in (0, 1):
                if s[cart] != 0.0:

                    def event(_t, z, cart=cart, s=s):
                        return z[1 + 2 * cart] * s[cart] + (1e-13 if z[1 + 2 * cart] == 0.0 else 0.0)

                    event.direction = -1
                else:

                    def event(t, z, cart=cart):
                        return self.over(cart, t, z, u)[0] - 1e-11

                    event.direction = 1
                event.terminal = True
                events.append(event)

            def rhs(t, z, s=s):
                force, fs = self.forces(t, z, u, s)
                acceleration = [
                    (force[c] - s[c] * self.level[c](t, z, s[c], fs)) / self.m[c] if s[c] else 0.0 for c in (0, 1)
                ]
                return [z[1], acceleration[0], z[3], acceleration[1], *self.rates(t, z, u)]

            solution = solve_ivp(rhs, (a, b), y, method="DOP853", events=events, rtol=1e-10, atol=1e-10)
            y, a = solution.y[:, -1].copy(), solution.t[-1]
            if solution.status != 1:
                return y
            released = [0.0, 0.0]
            for cart in (0, 1):
                if len(solution.t_events[cart]):
                    if s[cart] != 0.0:
                        y[1 + 2 * cart] = 0.0
                    else:
                        released[cart] = self.over(cart, a, y, u)[1]
        return y

    def run(self, t, u):
        """Piecewise-constant u; returns states (4, n) at the instants t."""
        y = np.array([0.0, 0.0, 0.0, 0.0, *self.extra_start])
        out = np.empty((4, len(t)))
        out[:, 0] = y[:4]
        for i in range(len(t) - 1):
            y = self.interval(t[i], t[i + 1], y, u[i])
            out[:, i + 1] = y[:4]
        return out
