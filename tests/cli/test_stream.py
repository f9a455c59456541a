"""`mpucal stream`: calibrated samples at once, in bounded memory, and readers that go away."""

import io
import json
import os
import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from mpucal.__main__ import run
from mpucal.files import load
from mpucal.result.calibration import Calibration

D = np.array([[1.021, 0.013, -0.007], [-0.009, 0.987, 0.021], [0.004, -0.016, 1.034]])
B_A = np.array([0.31, -0.22, 1.08])


def test_a_stream_is_calibrated(mpucal, made):
    words = ("stream", "--bus", "sim:seed=3", "--seconds", "3", "--apply", made)
    lines = mpucal(*words, "--json", "-o", "stream.mcap").out.splitlines()
    recording = load("stream.mcap")
    a, w = Calibration.load(made).apply(recording.acc, recording.gyr)
    rows = [json.loads(line) for line in lines]
    assert len(rows) > 400
    np.testing.assert_allclose([row["a"] for row in rows], a[: len(rows)], atol=1e-12)
    np.testing.assert_allclose([row["w"] for row in rows], w[: len(rows)], atol=1e-12)
    table = mpucal(*words).out.splitlines()
    assert table[0] == "t,ax,ay,az,gx,gy,gz,temperature_c,utc_s,calibrated_by_mpucal"
    assert all(0 <= time.time() - row["utc_ns"] * 1e-9 < 600 for row in rows[:1])
    assert rows[9]["utc_ns"] - rows[0]["utc_ns"] == pytest.approx((rows[9]["t"] - rows[0]["t"]) * 1e9, abs=2)
    np.testing.assert_allclose([float(v) for v in table[1].split(",")[1:4]], rows[0]["a"], atol=1e-12)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "calibration.json"
    Calibration(D, B_A, quality={"verdict": "good", "reasons": []}).save(path)
    return path


class Weighing(io.StringIO):
    """Output that keeps nothing, and measures the memory allocated since its first write at each further one."""

    def __init__(self):
        super().__init__()
        self.weights = []

    def write(self, text):
        return len(text)

    def flush(self):
        if not tracemalloc.is_tracing():
            tracemalloc.start()
        self.weights.append(tracemalloc.get_traced_memory()[0])


def test_memory_does_not_grow(made, monkeypatch):
    """Keep less than a third of the 170 kB that the samples of the second half take."""
    listener = Weighing()
    monkeypatch.setattr(sys, "stdout", listener)
    try:
        assert run(["stream", "--bus", "sim:seed=3", "--apply", str(made), "--seconds", "20"]) == 0
    finally:
        tracemalloc.stop()
    weights = listener.weights
    assert len(weights) > 20
    assert max(weights[len(weights) // 2 :]) - max(weights[: len(weights) // 2]) < 170_000 / 3


def test_a_line_comes_at_once_and_a_closed_pipe_is_no_error(made):
    """A buffer of 8 KiB would take a quarter of a minute to fill at 4 samples a second."""
    words = ["stream", "--bus", "sim:seed=3,pace=real", "--rate", "4"]
    with subprocess.Popen(
        [sys.executable, "-m", "mpucal", *words, "--apply", made],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as program:
        first = os.read(program.stdout.fileno(), 1 << 16)
        program.stdout.close()
        said = program.stderr.read().decode()
        assert program.wait(300) == 0, said
    assert first.startswith(b"t,ax,ay,az,gx,gy,gz")
    assert len(first) < 8192
    assert not said


def test_rests_that_contradict_the_calibration_are_reported_once(mpucal, session):
    calibration = Calibration.load(session.folder / "calibration.json")
    replace(calibration, b_a=calibration.b_a + np.array([0.0, 0.0, 0.3])).save("wrong.json")
    words = ("stream", "--bus", "sim:seed=3,hand=still", "--rate", "25", "--seconds", "30", "--watch", "--apply")
    assert "contradict" not in mpucal(*words, session.folder).err
    done = mpucal(*words, "wrong.json")
    assert (done.code, done.err.count("rests contradict the calibration (|a| is wrong by up to")) == (0, 1)
    assert done.out.count("\n") > 700
    (event,) = map(json.loads, mpucal(*words, "wrong.json", "--json-events").err.splitlines())
    assert (event["event"], event["code"]) == ("caution", "accelerometer_contradicted")
    assert 0.0 < event["t_s"] < 30.0
    assert f"{event['what']}: {event['do']}" in done.err
