"""The functions in other languages, run: they do what the calibration does."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from mpucal.export.c_code import c_functions
from mpucal.export.python import python_functions
from mpucal.export.ros import ros_node

Y = np.array([[0.5, -3.0, 9.0], [-9.7, 0.1, 0.4], [4.0, 6.0, -6.5]])
LIBRARY = Path(__file__).parents[2] / "mpucal" / "firmware" / "src"
MAIN = """
#include <stdio.h>
int main(void) {{
    const float y[][3] = {{{rows}}};
    for (int k = 0; k < 3; k++) {{
        float a[3];
        float w[3];
        mpucal_correct(y[k], a);
        mpucal_correct_gyro(y[k], w);
        printf("%.9g %.9g %.9g %.9g %.9g %.9g\\n", a[0], a[1], a[2], w[0], w[1], w[2]);
    }}
}}
"""


def test_c_computes_what_the_calibration_does(calibrated, tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler here")
    rows = ", ".join("{" + ", ".join(map(str, row)) + "}" for row in Y)
    (tmp_path / "apply.c").write_text(f'#include "mpucal_apply.h"\n{c_functions(calibrated)}{MAIN.format(rows=rows)}')
    words = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{LIBRARY}", "-o", "apply", "apply.c"]
    subprocess.run(words, cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "apply"], capture_output=True, text=True, check=True).stdout
    np.testing.assert_allclose(
        [list(map(float, line.split())) for line in printed.splitlines()], np.hstack(calibrated.apply(Y, Y)), atol=1e-5
    )


def test_c_says_what_a_count_is(calibration):
    scale = float(re.search(r"one count of the chip is (\S+) m/s\^2", c_functions(calibration))[1])
    np.testing.assert_allclose(scale * 32768, calibration.sensor.accel_range_g * 9.80665)


def test_python_computes_what_the_calibration_does(calibrated):
    names = {}
    exec(python_functions(calibrated), names)
    np.testing.assert_allclose(names["apply"](Y), calibrated.apply(Y), atol=1e-6)


def test_the_node_publishes_what_it_hears_calibrated(calibrated, monkeypatch):
    published = []

    class Node:
        def __init__(self, name):
            self.listening = {}

        def create_publisher(self, kind, topic, depth):
            assert topic == "imu/data"
            return SimpleNamespace(publish=published.append)

        def create_subscription(self, kind, topic, hear, depth):
            assert topic == "imu/data_raw"

    for name, contents in (
        ("rclpy", {}),
        ("rclpy.node", {"Node": Node}),
        ("sensor_msgs", {}),
        ("sensor_msgs.msg", {"Imu": SimpleNamespace}),
    ):
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    names = {"__name__": "node"}
    exec(ros_node(calibrated), names)
    node = names["Calibrated"]()
    for y in Y:
        x, y_, z = y.tolist()
        node.correct(SimpleNamespace(linear_acceleration=SimpleNamespace(x=x, y=y_, z=z)))
    heard = [(m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z) for m in published]
    np.testing.assert_allclose(heard, calibrated.apply(Y), atol=1e-6)
    np.testing.assert_allclose(
        np.reshape(published[0].linear_acceleration_covariance, (3, 3)), np.diag(calibrated.noise_std**2), rtol=1e-5
    )
