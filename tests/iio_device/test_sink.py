"""A kernel driver as a sink: calibbias verified in the samples, the udev rule, and everything restored on failure."""

import json
from dataclasses import replace

import numpy as np
import pytest

from mpucal.chip.config import RateOnlyConfig
from mpucal.chip.offsets import RESERVED_BIT
from mpucal.data import STANDARD_GRAVITY_MPS2, Sensor
from mpucal.errors import RecordingError, WriteBackError
from mpucal.iio.driver import Devices
from mpucal.iio_device.sink import KernelSink
from mpucal.iio_device.source import OpenedIio
from mpucal.result.calibration import REFUSED, Calibration
from mpucal.session.events import Prompt, PromptKind
from mpucal.session.plan import Plan
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.iio import SimulatedFiles

BIAS = np.array([0.32, -0.11, -0.53])
# scale of a count by the data sheet, which D is of, over that of inv_mpu6050, at 2 g
RATIO = STANDARD_GRAVITY_MPS2 / 16384 / 0.000598
BOTH = Devices("iio:device0", "iio:device0")


@pytest.fixture
def made(tmp_path):
    """A sink on a chip at rest, its files, and a calibration whose bias and trim are this chip's."""

    def make(chip="mpu6050", **sensor):
        bus = open_simulated(f"sim:chip={chip},hand=still,seed=4,b_a=0.32/-0.11/-0.53,D=1/0/0/0/1/0/0/0/1")
        bus.hear(Prompt(PromptKind.LAY_FLAT, ""))
        files = SimulatedFiles(bus)
        sink = KernelSink(OpenedIio(files, Plan(RateOnlyConfig(rate_hz=50)), devices=BOTH, rules=tmp_path))
        name = {"mpu6050": "MPU-6050", "mpu6500": "MPU-6500"}[chip]
        held = Sensor(chip=name, accel_offsets=files._words()) if not sensor else Sensor(**sensor)
        return sink, files, calibration(held)

    return make


def calibration(sensor):
    return Calibration(
        D=np.array([[1.02, 0, 0], [0.01, 0.98, 0], [0, -0.02, 1.0]]),
        b_a=BIAS,
        K=np.eye(3),
        b_omega=np.zeros(3),
        D_std=np.full((3, 3), 1e-4),
        b_a_std=np.full(3, 1e-3),
        sensor=sensor,
    )


def test_b_a_is_gone_from_the_samples_and_udev_has_the_rest(made, tmp_path):
    sink, files, found = made()
    before, kept = files._words(), sink.keep(tmp_path)[0]
    # the device tree's matrix stays in that of udev
    sink._decoder.texts("iio:device0")["in_mount_matrix"] = "0, 1, 0; -1, 0, 0; 0, 0, 1"
    applied = sink.write(found)
    # steps of 1 mg
    np.testing.assert_allclose(applied.calibration.applied_in_hardware, BIAS, atol=0.6e-3 * STANDARD_GRAVITY_MPS2)
    assert all((new ^ old) & RESERVED_BIT == 0 for new, old in zip(files._words(), before, strict=True))
    rule = (tmp_path / "61-mpucal-iio-device0.rules").read_text()
    assert 'KERNEL=="iio:device0", ATTR{name}=="mpu6050"' in rule
    text = rule.partition('ENV{ACCEL_MOUNT_MATRIX}="')[2].partition('"')[0]
    rows = np.array([[float(value) for value in row.split(",")] for row in text.split(";")])
    np.testing.assert_allclose(rows @ found.D, RATIO * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), atol=1e-8)
    assert "read back and verified in the samples" in applied.what
    sink.put_back(kept)
    assert files._words() == before
    assert not list(tmp_path.glob("*.rules"))


def test_calibbias_of_an_mpu_6500_is_left_alone(made):
    sink, files, found = made("mpu6500")
    before = files._words()
    applied = sink.write(found)
    assert files._words() == before
    assert not applied.calibration.applied_in_hardware.any()
    assert "calibbias is not used, as the driver writes to wrong registers" in applied.what


def test_a_change_that_the_samples_do_not_show_is_undone(made, tmp_path, monkeypatch):
    sink, files, found = made()
    before, write = files._words(), files._write_words

    def other_axes(words):
        write((words[1], words[0], words[2]) if words != before else words)

    monkeypatch.setattr(files, "_write_words", other_axes)
    monkeypatch.setattr(files, "_words", lambda: files._written or before)
    with pytest.raises(WriteBackError, match=r"the samples changed by .*iio:device0 \(mpu6050\) is restored"):
        sink.write(found)
    assert files._written == before
    assert not list(tmp_path.glob("*.rules"))


def test_refused_calibrations_and_invalid_states_are_not_written(made, tmp_path):
    sink, _, found = made()
    with pytest.raises(WriteBackError, match="nothing was written: the calibration was refused"):
        sink.write(replace(found, quality={"verdict": REFUSED}))
    state = {"format": "mpucal.iio_state", "calibbias": [1, 2, 3], "rule": None}
    for document in ({}, 5, {**state, "calibbias": ["1", 2, 3]}, {**state, "rule": 5}):
        (tmp_path / "x.json").write_text(json.dumps(document))
        with pytest.raises(RecordingError, match="does not hold calibbias"):
            sink.put_back(tmp_path / "x.json")
