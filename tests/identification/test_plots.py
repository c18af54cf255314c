"""What the handout asks of each figure: panels, axes, units, ranges."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from flexdrive_gym import Drive, Excitation, Fault, LinearDrive, PControl
from identification.frequency_response import measure_frequency_response
from identification.plots import (
    caption_of_sines,
    plot_bode,
    plot_damped_frequency,
    plot_pole_zero,
    plot_recording,
    plot_sines,
    plot_steady_state,
    plot_time_constant,
    plot_validation,
    plot_zeta_iteration,
)
from identification.recordings import read_recordings
from identification.step_response import identify_by_handout

RIG = Drive({"m1": 5e-4, "m2": 2.7e-4, "b1": 8e-3, "b2": 8e-4, "d1": 0.5, "d2": 0.05, "k": 0.09})
T = 1e-3 * np.arange(4001)


def square(amplitude):
    run = RIG.simulate(T, np.where(np.floor(T + 1e-9) % 2 == 0, -amplitude, amplitude), name=f"square {amplitude}")
    return replace(run, excitation=Excitation("square", amplitude, 0.5))


def sine(frequency):
    run = RIG.simulate(T, 2.5 * np.sin(2.0 * np.pi * frequency * T), name=f"sine {frequency}")
    return replace(run, excitation=Excitation("sine", 2.5, frequency))


@pytest.fixture(scope="module")
def result():
    return identify_by_handout([square(1.5), square(2.0)])


@pytest.fixture(scope="module")
def sines():
    return [sine(f) for f in (1.0, 2.0, 3.0, 4.0, 5.0, 12.0)]


def drawn(figure):
    """Draw for real, so that labels, mathtext and layout are exercised."""
    assert isinstance(figure, Figure)
    figure.canvas.draw()
    return figure.axes


def texts(figure):
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_steady_state_shows_each_amplitude_and_the_line(result):
    figure = plot_steady_state(result)
    *panels, line = drawn(figure)
    assert [axes.get_title("left")[:4] for axes in panels] == ["±2 V", "±1.5"]
    assert line.get_xlabel() == "amplitude $u_0$ [V]"
    x, y = line.lines[0].get_data()
    assert np.polyfit(x, y, 1)[0] == pytest.approx(1.0 / result["bT"])
    assert y[0] == 0.0
    assert x[0] == pytest.approx(result["dT"])


def test_time_constant_states_both_values_of_p(result):
    figure = plot_time_constant(result)
    drawn(figure)
    assert f"{result.time_constant.p_read:.1f} 1/s as read" in texts(figure)
    assert f"{result.time_constant.p_corrected:.1f} 1/s corrected" in texts(figure)


def test_rigid_curve_of_the_time_constant_passes_through_the_reading(result):
    axes = plot_time_constant(result).axes[0]
    curve = next(line for line in axes.lines if str(line.get_label()).startswith("rigid"))
    reading = result.time_constant
    assert np.interp(reading.t63, *curve.get_data()) == pytest.approx(reading.level, abs=0.01 * reading.vss)


def test_damped_frequency_marks_the_extrema_used(result):
    _, bottom = drawn(plot_damped_frequency(result))
    marks = next(line for line in bottom.lines if line.get_label() == "extrema used")
    assert marks.get_xdata() == pytest.approx(result.vibration.peak_times)


def test_zeta_iteration_shows_every_pass(result):
    zeta, omega_n, k = drawn(plot_zeta_iteration(result))
    assert [len(axes.lines[0].get_xdata()) for axes in (zeta, omega_n, k)] == [len(result.iterations)] * 3


def test_bode_has_the_handouts_axes(result, sines):
    table = measure_frequency_response(sines)
    figures = plot_bode(RIG.linear, table, RIG, 2.5)
    assert len(figures) == 2
    for cart, figure in enumerate(figures, start=1):
        gain, phase = drawn(figure)
        assert (gain.get_xscale(), gain.get_yscale(), phase.get_yscale()) == ("log", "log", "linear")
        assert gain.get_xlim() == (0.1, 1000.0)
        assert "[(mm/s)/V]" in gain.get_ylabel()
        assert "[rad/s]" in phase.get_xlabel()
        assert "[deg]" in phase.get_ylabel()
        theory = gain.lines[0]
        assert len(theory.get_xdata()) == 1000
        assert theory.get_ydata()[0] == pytest.approx(1.0 / 8.8e-3, rel=1e-3)
        labels = [text.get_text() for text in gain.get_legend().get_texts()]
        assert any("describing function" in label for label in labels)
        assert any("measured" in label for label in labels)
        assert f"v_{cart}" in gain.get_ylabel()


def test_bode_takes_the_amplitude_from_the_table_or_asks(sines):
    first, _ = plot_bode(RIG.linear, measure_frequency_response(sines), RIG)
    assert "±2.5 V" in first.axes[0].get_legend().get_texts()[1].get_text()
    with pytest.raises(ValueError, match="amplitude: friction's effect depends on it"):
        plot_bode(RIG.linear, None, RIG)


def test_pole_zero_maps_are_figure_3():
    left, right = drawn(plot_pole_zero(RIG.linear))
    points = {axes: {line.get_label(): line for line in axes.lines} for axes in (left, right)}
    assert len(points[left]["poles"].get_xdata()) == 4
    assert len(points[left]["zeros"].get_xdata()) == 2
    assert "zeros" not in points[right]
    with pytest.raises(ValueError, match="Figure 3 needs both carts"):
        plot_pole_zero(LinearDrive(7e-4, np.inf, 9e-3, 0.0, 0.0))


def test_open_loop_run_has_velocities_on_top_and_the_command_below():
    top, bottom = drawn(plot_recording(square(2.0)))
    assert [text.get_text() for text in top.get_legend().get_texts()] == ["$v_1$", "$v_2$"]
    assert top.get_ylabel() == "velocity [mm/s]"
    assert bottom.get_ylabel() == "command $u$ [V]"
    assert bottom.get_xlabel() == "time $t$ [s]"


def test_closed_loop_run_has_the_four_panels_of_the_report():
    reference = np.where(T > 0.5, 20.0, 0.0)
    run = RIG.simulate_closed_loop(T, reference, PControl(0.05))
    panels = drawn(plot_recording(run))
    assert len(panels) == 4
    error = panels[2]
    assert error.lines[0].get_ydata() == pytest.approx(reference - run.x2)
    assert error.get_ylabel() == "error $x_r - x_2$ [mm]"
    assert panels[3].get_ylabel() == "command $u$ [V]"


def test_faults_are_shaded_where_they_are():
    run = square(2.0)
    top, bottom = drawn(
        plot_recording(replace(run, faults=(Fault(run.name, "encoder_1", "encoder_dropout", 1.2, 1.4),)))
    )
    assert "encoder dropout" in [text.get_text() for text in top.get_legend().get_texts()]
    assert len(top.patches) == 1
    assert len(bottom.patches) == 0


def test_sines_show_four_frequencies_and_the_caption(sines):
    figure = plot_sines(sines, natural_frequency=3.5)
    panels = drawn(figure)
    assert len(panels) == 8
    shown = [axes.get_title("left") for axes in panels[:4]]
    assert shown[0] == "1 Hz"
    assert shown[-1] == "12 Hz"
    caption = caption_of_sines(sines, natural_frequency=3.5)
    assert caption.startswith("Natural frequency 3.5 Hz (22 rad/s, identified)")
    assert "cart 2 lags cart 1 by" in caption


def test_sines_need_not_be_four(sines):
    assert len(drawn(plot_sines(sines[:1]))) == 2


def test_validation_overlays_simulation_on_measurement():
    run = square(1.5)
    v1, v2, u = drawn(plot_validation(run, RIG.simulate(run.t, run.u)))
    for axes in (v1, v2):
        assert [text.get_text() for text in axes.get_legend().get_texts()] == ["measured", "simulated"]
    assert "v_1" in v1.get_ylabel()
    assert "v_2" in v2.get_ylabel()
    assert "u" in u.get_ylabel()


def test_figures_do_not_change_the_users_settings(result):
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    plot_time_constant(result)
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize("rig", ["mte360_2022", "mte360_2025"])
def test_figures_of_the_real_rigs_draw(shared_recordings, rig):
    recordings = read_recordings(shared_recordings / rig)
    found = identify_by_handout(recordings)
    table = measure_frequency_response(recordings)
    for plot in (plot_steady_state, plot_time_constant, plot_damped_frequency, plot_zeta_iteration):
        drawn(plot(found))
    for figure in plot_bode(found.drive().linear, table, found.drive()):
        drawn(figure)
    drawn(plot_sines(recordings))
    drawn(plot_recording(next(run for run in recordings if run.closed_loop)))
