"""An independent integration of the two masses with dry friction: event-driven, adaptive, by another library.

Nothing of the package is used: the equations of the handout are written out once more, one right-hand side per mode
(which carts slide, and which way), and scipy's integrator runs each mode to its event at tight tolerance.
"""

import numpy as np
from scipy.integrate import solve_ivp


class TwoMasses:
    def __init__(self, m1, m2, b1, b2, d1, d2, k, C=0.0):
        self.m1, self.m2, self.b1, self.b2, self.d1, self.d2, self.k, self.C = m1, m2, b1, b2, d1, d2, k, C

    def free_forces(self, y, u):
        x1, v1, x2, v2 = y
        spring = self.k * (x1 - x2) + self.C * (v1 - v2)
        return u - spring - self.b1 * v1, spring - self.b2 * v2

    def mode(self, y, u):
        """Direction of each cart: the velocity's sign, or at rest that of the force beyond friction, or 0."""
        result = []
        for v, force, d in zip((y[1], y[3]), self.free_forces(y, u), (self.d1, self.d2), strict=True):
            if abs(v) > 0.0:
                result.append(np.sign(v))
            else:
                result.append(np.sign(force) if abs(force) > d * (1 + 1e-12) else 0.0)
        return result

    def run(self, t, u):
        """Piecewise-constant u; returns states (4, n) at the instants t."""
        y = np.zeros(4)
        out = np.empty((4, len(t)))
        out[:, 0] = y
        for i in range(len(t) - 1):
            y = self.interval(t[i], t[i + 1], y, u[i])
            out[:, i + 1] = y
        return out

    def interval(self, a, b, y, u):
        for _ in range(50):
            s = self.mode(y, u)
            events = []
            for cart in (0, 1):
                if s[cart] != 0.0:

                    def back_to_zero(_t, state, cart=cart, s=s):
                        return state[1 + 2 * cart] * s[cart] + (1e-13 if state[1 + 2 * cart] == 0.0 else 0.0)

                    back_to_zero.terminal, back_to_zero.direction = True, -1
                    events.append((cart, back_to_zero))
                else:

                    def torn_loose(_t, state, cart=cart):
                        return abs(self.free_forces(state, u)[cart]) - (self.d1, self.d2)[cart] * (1 + 1e-11)

                    torn_loose.terminal, torn_loose.direction = True, 1
                    events.append((cart, torn_loose))

            def rhs(_t, state, s=s):
                f1, f2 = self.free_forces(state, u)
                return [
                    state[1],
                    (f1 - s[0] * self.d1) / self.m1 if s[0] else 0.0,
                    state[3],
                    (f2 - s[1] * self.d2) / self.m2 if s[1] else 0.0,
                ]

            solution = solve_ivp(
                rhs, (a, b), y, method="DOP853", events=[e for _c, e in events], rtol=1e-11, atol=1e-11
            )
            y = solution.y[:, -1].copy()
            a = solution.t[-1]
            if solution.status != 1:
                return y
            for (cart, _event), times in zip(events, solution.t_events, strict=True):
                if len(times) and s[cart] != 0.0:
                    y[1 + 2 * cart] = 0.0
        return y
