import sys

import numpy as np
import pytest

from mpucal.calibration.rotation import rotation
from tools.lab import figures
from tools.lab.scenarios.recordings import GRAVITY_MPS2, hand_scenario


@pytest.fixture
def plt():
    matplotlib = pytest.importorskip("matplotlib", reason="the extra `plot` is not installed")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 30.0, 90.0, 179.9])
def test_an_angle_is_that_of_the_rotation_whatever_the_lengths(degrees):
    a = np.array([[1.0, 0.0, 2.0]])
    turn = rotation(np.radians(degrees) * np.array([0.0, 1.0, 0.0]))
    assert figures.angles(a, 3.0 * a @ turn.T)[0] == pytest.approx(degrees, abs=1e-9)


def test_smoothing_keeps_a_constant_to_its_ends():
    np.testing.assert_allclose(figures.smoothed(np.full(20, 9.81), 5), 9.81)


def test_the_sweep_shows_what_calibration_gains():
    run = figures.sweep(0, "accel")
    before, after = run.angles
    assert len(run.t) == len(after)
    assert after.mean() < 0.5 * before.mean()
    assert abs(run.magnitudes[1].mean() - GRAVITY_MPS2) < 0.1


def test_magnitudes_are_drawn_a_recording_a_row(plt):
    recording = hand_scenario(1, "pose12", rate_hz=50.0).recording
    drawn = figures.magnitudes(plt, [recording, recording], GRAVITY_MPS2)
    assert [axes.get_title(loc="left") or axes.get_title() for axes in drawn.axes] == [recording.name] * 2
    line = max(drawn.axes[0].lines, key=lambda line: line.get_label().startswith("calibrated"))
    still = np.asarray(line.get_ydata())[50:400]
    np.testing.assert_allclose(still, GRAVITY_MPS2, atol=0.05)


def test_the_command_saves_what_it_says(plt, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["figures.py", "-o", str(tmp_path), "--figure", "1", "--format", "svg"])
    assert figures.main() == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / "figure_1.svg")]
    assert (tmp_path / "figure_1.svg").read_text().count("<path") > 10


def test_without_matplotlib_the_remedy_is_said(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setattr(sys, "argv", ["figures.py"])
    assert figures.main() == 2
    assert "pip install" in capsys.readouterr().err
