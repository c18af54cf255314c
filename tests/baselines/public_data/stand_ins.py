"""Files in the benchmarks' formats whose physics is known: simulated, because the real ones may not be copied."""

from dataclasses import replace

import numpy as np

from flexdrive_gym import Drive, PControl
from flexdrive_gym.recording import Recording
from identification.replay.output_error import prepare, simulate_run
from identification.topology import GROUND_MASS

CARRIAGE = {"m1": 2.6e-3, "b1": 5.5e-3, "d1": 0.6, "input_offset.u0": 0.1}
BELT = {"m1": 7e-4, "m2": 1.2e-3, "b1": 8e-3, "k": 0.3, "d1": 0.3}
OSCILLATOR = {"m1": 9.7e-6, "m2": GROUND_MASS, "b1": 1.35e-4, "k": 0.198, "hardening_spring.k3": 7.8e-5}
HEADERS = {"emps": "t_s,u_V,qref_m,q_m", "coupled_drives": "t_s,u_V,speed_ticks_s", "silverbox": "t_s,u_V,y_V"}


def write(path, name, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=HEADERS[name], comments="")


def lose(path, samples):
    """Lose some samples of the output, which stands last, as a logger does that writes nan for them."""
    lines = path.read_text().splitlines()
    for n in samples:
        # below a header
        lines[n + 1] = f"{lines[n + 1].rsplit(',', 1)[0]},nan"
    path.write_text("\n".join(lines) + "\n")


def write_carriage(path, seconds, seed):
    """One carriage that follows moves under P-control, in metres."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * 1000)) * 1e-3
    knots = np.arange(0.0, seconds + 1.0, 0.8)
    reference = np.interp(t, knots, rng.uniform(0.0, 200.0, len(knots)))
    run = Drive(CARRIAGE).simulate_closed_loop(t, reference, PControl(0.15, "x1"))
    quantum = 5e-8
    write(path, "emps", t, run.u, reference * 1e-3, np.round(run.x1 * 1e-3 / quantum) * quantum)


def write_belt(path, n, seed, shift=0.0):
    """Two inertias under random holds, seen by a pulse counter on the second."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.5, 2.5, n // 8 + 1), 8)[:n] + shift
    t = np.arange(n) * 0.02
    run = Drive(BELT).simulate(t, u)
    write(path, "coupled_drives", t, u, np.abs(run.v2) / 100.0 + 0.003 * rng.standard_normal(n))


def write_oscillator(path, n, seed, *, grow=False):
    """A mass on a cubic spring to the ground, driven by a multisine of up to 200 Hz, constant or growing to twice its size."""
    rng = np.random.default_rng(seed)
    h = 2.0**14 / 1e7
    f = np.fft.rfftfreq(n, h)
    u = np.fft.irfft(np.where(f < 200.0, np.exp(2j * np.pi * rng.random(len(f))), 0.0), n)
    u *= 0.022 / np.std(u) * (np.linspace(0.0, 2.0, n) if grow else 1.0)
    t = np.arange(n) * h
    still = Recording("stand-in", t * 3.0, u * 20.0, x1=np.zeros(n), hold="band_limited")
    y = simulate_run(OSCILLATOR, replace(prepare(still), positions=True))[0] / 100.0
    write(path, "silverbox", t, u, y + 1e-4 * rng.standard_normal(n))
