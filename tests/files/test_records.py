"""Binary records of equal size, and matrices of several sensors: physics shows what they hold."""

import numpy as np
import pytest

import mpucal
from mpucal.data import GYRO_COUNTS
from mpucal.errors import RecordingError

RNG = np.random.default_rng(0)
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SHAKEN = 200


def of_sensors(walk, count):
    """The walk's accelerations and rates as `count` sensors measure them, each turned by 90 degrees from the last."""
    turned = [np.linalg.matrix_power(TURNED, k) for k in range(count)]
    return [part @ each.T for each in turned for part in (walk.acc, walk.gyr)]


def packets(walk, counts):
    """Packets of a radio: a mark, a counter, a length, a clock, counts and a sum, behind four odd bytes."""
    n = len(walk)
    fields = [("mark", "u1"), ("i", ">u2"), ("size", "u1"), ("at", ">u4"), ("of", ">i2", 18), ("sum", ">u2")]
    body = np.zeros(n, fields)
    body["mark"], body["i"], body["size"], body["at"] = 0xAA, np.arange(n) % 256 + 700, 44, np.arange(n) * 640_000
    body["of"], body["sum"] = counts, counts.sum(axis=1) % 65536
    return b"\x01\x02\x03\x04" + body.tobytes()


def test_packets_of_an_array_of_sensors(walk, assert_same, tmp_path):
    path = tmp_path / "data.bin"
    si = np.hstack(of_sensors(walk, 3))
    scale = np.tile([9.80665 / 2048] * 3 + [np.radians(2000) / GYRO_COUNTS] * 3, 3)
    path.write_bytes(packets(walk, np.rint(si / scale)))
    assert_same(mpucal.load(path, rate=100), walk, acc=0.003, gyr=0.001)
    third = mpucal.load(path, rate=100, sensor="3")
    np.testing.assert_allclose(third.acc, si[:, 12:15], atol=0.003)
    assert "records of 46 bytes" in third.taken
    assert "3 sensors are side by side, of which number 3 was read (--sensor chooses)" in third.taken
    without = mpucal.load(path)
    assert np.isnan(without.gyr).all()
    assert "--rate HZ" in without.taken


def test_a_structure_of_one_sensor(walk, assert_same, tmp_path):
    made = np.zeros(len(walk), [("us", "<u4"), ("of", "<f4", 6)])
    made["us"], made["of"] = np.arange(len(walk)) * 10_000, np.hstack([walk.acc, walk.gyr])
    (tmp_path / "imu.bin").write_bytes(made.tobytes())
    assert_same(mpucal.load(tmp_path / "imu.bin", rate=100), walk, acc=1e-5, gyr=1e-6)


@pytest.mark.parametrize("content", [b"", b"\0" * 5000, RNG.bytes(5000), b"a text\n" * 100])
def test_bytes_in_which_no_gravity_turns(content, tmp_path):
    (tmp_path / "a.bin").write_bytes(content)
    with pytest.raises(RecordingError, match=r"is not a dataflash log of ArduPilot, nor of records|is empty"):
        mpucal.load(tmp_path / "a.bin")


@pytest.mark.parametrize("by_rows", [True, False])
def test_a_matrix_of_sensors_side_by_side(by_rows, walk, assert_same, tmp_path):
    h5py = pytest.importorskip("h5py")
    made = np.hstack(of_sensors(walk, 3))
    with h5py.File(tmp_path / "a.hdf", "w") as file:
        file["data"] = made if by_rows else made.T
    assert_same(mpucal.load(tmp_path / "a.hdf", rate=100), walk)
    np.testing.assert_allclose(mpucal.load(tmp_path / "a.hdf", rate=100, sensor="2").acc, made[:, 6:9])
    with pytest.raises(RecordingError, match="its sensors are 1, 2, 3"):
        mpucal.load(tmp_path / "a.hdf", sensor="4")


def test_a_shake_at_the_end_hides_no_turns(walk, assert_same, tmp_path):
    made = np.hstack([walk.acc, walk.gyr])
    made[-SHAKEN:] += RNG.normal(0.0, 30.0, (SHAKEN, 6))
    np.savetxt(tmp_path / "a.txt", made)
    read = mpucal.load(tmp_path / "a.txt", rate=100)
    np.testing.assert_allclose(read.gyr, made[:, 3:])
