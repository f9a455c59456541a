"""`mpucal stream --page`: what is shown is what is printed."""

import json
import subprocess
import sys
import urllib.request
from contextlib import closing

import numpy as np
import pytest

from mpucal.result.calibration import Calibration

B_A = np.array([0.3, -0.2, 1.0])


@pytest.mark.slow
def test_the_values_are_those_that_are_printed(tmp_path, tab):
    Calibration(np.eye(3), B_A).save(tmp_path / "c.json")
    words = ["stream", "--bus", "sim:pace=real,hand=still", "--seconds", "4", "--apply", "c.json", "--json", "--page"]
    program = [sys.executable, "-m", "mpucal", *words]
    with (
        (tmp_path / "out").open("w") as out,
        subprocess.Popen(program, cwd=tmp_path, stdout=out, stderr=-1, text=True) as it,
    ):
        url = it.stderr.readline().split()[-1]
        with closing(urllib.request.urlopen(f"{url}events", timeout=20.0)) as events:
            tab.goto(url)
            changes = [json.loads(line[5:]) for line in events if line.startswith(b"data:")]
        tab.wait_for_selector("text=The stream has ended.")
    rows = [json.loads(line) for line in (tmp_path / "out").read_text().splitlines()]
    shown = [one["live"]["acc"] for one in changes if "live" in one]
    printed = np.array([row["a"] for row in rows])
    assert len(shown) > 4
    np.testing.assert_allclose(np.mean(shown, axis=0), printed.mean(axis=0), atol=0.1)
    assert tab.inner_text("#headline").endswith(" m/s²")
