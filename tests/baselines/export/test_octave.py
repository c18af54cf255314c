"""Drives in Octave against our own step: the same operations in the same order give the same numbers."""

import shutil

import numpy as np
import pytest

from baselines.export import export_matlab, verify_matlab
from baselines.export.verify import octave
from flexdrive_gym import Drive
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.units import Units
from tests.drive.drives import RIG
from tests.each import each

pytestmark = pytest.mark.skipif(
    not (shutil.which("octave-cli") or shutil.which("octave")),
    reason="no octave on this machine: apt-get install octave octave-control",
)
LIMITED = {**RIG, "saturation.limit": 8.0}
# round-off, which stick-slip hardly amplifies: the table of a linear drive sums in another order than the integrator
TOLERANCE = 1e-11
# other units round everything otherwise, and stiff contacts amplify it; a constant that kept the lab's unit would show as 1e-3
TOLERANCE_OF_UNITS = 1e-8
SOME = {"stribeck.cart_1.extra": 0.1, "presliding.cart_2.fd": 0.1, "amplifier_lag.tau": 0.003, "input_delay.tau": 0.0023,
        "motor_gear_backlash.mass": 1e-4, "encoder_play.encoder_1.g": 0.2}  # fmt: skip
ODD = Units("rad", "N m", 123.0, 7.0, 1.7)


@pytest.mark.parametrize(
    ("values", "units", "period"),
    [
        pytest.param({}, Units(), 1e-3, id="base"),
        pytest.param(
            {**SOME, "encoder_quantisation.encoder_1.quantum": 0.0046592},
            Units(),
            2e-3,
            id="effects",
            marks=pytest.mark.slow,
        ),
        pytest.param(SOME, ODD, 1e-3, id="units", marks=pytest.mark.slow),
    ],
)
def test_the_same_numbers(values, units, period):
    drive = Drive({**LIMITED, **values}, units=units)
    exported = export_matlab(drive, "rig", sample_time=period / units.per_time)
    for d in verify_matlab(drive, exported, "rig", period):
        # a reading at the edge of a count may round either way
        limit = TOLERANCE if units.lab else TOLERANCE_OF_UNITS
        if "encoder_quantisation.encoder_1.quantum" in values:
            limit = 1e-3
        assert d.relative < limit, d
        if d.case == "at rest" and d.signal.startswith("v") and "motor_gear_backlash.mass" not in values:
            assert d.peak == d.largest == 0.0


@pytest.mark.slow
def test_every_effect_gives_the_same_numbers(tmp_path):
    t = np.arange(400) * 1e-3
    u = 1.5 * np.sin(4.0 * np.pi * t) + 0.3 * np.sign(np.sin(6.2 * np.pi * t))
    u[:30] = 0.3
    np.savetxt(tmp_path / "u.csv", u, fmt="%.17g")
    runs, script = {}, ["u = dlmread('u.csv');"]
    for effect in EFFECTS:
        for where in effect.where:
            own = {effect.key(where, q.name): q.starts[0] for q in effect.parameters if q.starts}
            drive, name = Drive({**own, **LIMITED} if effect.base else {**LIMITED, **own}), f"d_{effect.id}_{where}"
            (tmp_path / f"{name}.m").write_text(export_matlab(drive, name).text, encoding="utf-8")
            runs[name] = drive.simulate(t, u)
            script.append(f"d = {name}(); dlmwrite('{name}.csv', d.simulate(u, d.p), 'precision', '%.17g');")
    octave(tmp_path, "\n".join(script))
    for name, run in runs.items():
        y = np.loadtxt(tmp_path / f"{name}.csv", delimiter=",")
        for i, ours in enumerate((run.x1, run.x2, run.v1, run.v2)):
            assert np.max(np.abs(y[:, i] - ours)) <= TOLERANCE * np.max(np.abs(ours)), name


@each("carts", [1, 2])
def test_the_linear_model(tmp_path, carts):
    one = {"m1": 1.1e-3, "b1": 0.0128, "d1": 0.6}
    drive = Drive({**RIG, "C": 2e-4} if carts == 2 else one)
    (tmp_path / "rig.m").write_text(export_matlab(drive, "rig").text, encoding="utf-8")
    octave(
        tmp_path,
        "d = rig(); dlmwrite('den.csv', d.den, 'precision', '%.17g'); dlmwrite('num.csv', d.num{end}, 'precision', '%.17g');\n"
        "dlmwrite('A.csv', d.A, 'precision', '%.17g'); dlmwrite('B.csv', d.B, 'precision', '%.17g');\n"
        "try, pkg load control; d = rig(); dlmwrite('dc.csv', [pole(d.sys)'; pole(d.G1)'](:, 1)'); catch, end",
    )
    den, num, A, B = (np.loadtxt(tmp_path / f"{n}.csv", delimiter=",", ndmin=1) for n in ("den", "num", "A", "B"))
    linear, system = drive.linear, drive.linear.state_space()
    assert den == pytest.approx(linear.denominator, rel=1e-13)
    assert np.trim_zeros(num, "f") == pytest.approx(linear.numerator("x2" if carts == 2 else "x1"), rel=1e-13)
    assert pytest.approx(np.asarray(system.A), rel=1e-13) == A
    assert pytest.approx(np.asarray(system.B)[:, 0], rel=1e-13) == B
