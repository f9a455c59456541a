"""A calibration like a real one, samples, and a compiler."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.data import Sensor
from mpucal.result.calibration import Calibration

D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
LIBRARY = Path(__file__).parents[2] / "mpucal" / "firmware" / "src"


@pytest.fixture
def calibration():
    return Calibration(
        D,
        np.array([0.31, -0.22, 1.08]),
        np.full((3, 3), 2e-4),
        np.full(3, 0.005),
        noise_std=np.array([0.02, 0.021, 0.03]),
        K=np.array([[1.01, 0.002, 0.0], [0.002, 0.98, -0.004], [0.0, -0.004, 1.0]]),
        b_omega=np.array([0.02, -0.03, 0.01]),
        gyro_noise_std=np.full(3, 0.001),
        fit={"gravity": 9.80665, "model": "hand"},
        quality={"verdict": "good", "reasons": []},
        sensor=Sensor("MPU-6050", 0x68, 4.0, 500.0, 200.0, 27.5, (-1501, 2000, 701)),
        created="2024-05-17T09:30:00+00:00",
    )


@pytest.fixture(params=[np.zeros(3), np.array([0.25, -0.2, 1.0])], ids=["nothing applied", "applied in hardware"])
def calibrated(request, calibration):
    return replace(calibration, applied_in_hardware=request.param)


@pytest.fixture
def samples():
    """(200, 3) m/s^2 as measured."""
    return np.random.default_rng(2).uniform(-35.0, 35.0, (200, 3))


@pytest.fixture(scope="session")
def compiled(need):
    """Return a function that compiles a program, and returns what runs it: text in, rows of numbers out."""

    def compiled(folder, name, source, *flags):
        compiler = "g++" if name.endswith(".cpp") else "gcc"
        need(compiler)
        (folder / name).write_text(source)
        words = [compiler, "-Wall", "-Werror", *flags, "-I.", f"-I{LIBRARY}", "-o", "program", name]
        subprocess.run(words, cwd=folder, check=True)

        def run(text=""):
            done = subprocess.run([folder / "program"], input=text, capture_output=True, text=True, check=True)
            return np.array([line.split() for line in done.stdout.splitlines()], float)

        return run

    return compiled
