"""Units and layouts of tables that few programs write: each gives the samples back."""

import json
import math
import re

import numpy as np
import pandas as pd
import pytest

import mpucal
from mpucal.errors import RecordingError

G = 9.80665
NAMES = [f"{of}_{axis}" for of in ("acc", "gyr") for axis in "xyz"]
HEADER = f"ms,{','.join(NAMES)}"
TWO_PERCENT = 0.02


@pytest.fixture
def ms(walk):
    return np.rint(1e3 * (walk.t - walk.t[0]))


def same(found, walk, rtol=1e-6, gyr_atol=1e-6):
    np.testing.assert_allclose(found.acc, walk.acc, rtol=rtol, atol=1e-2)
    np.testing.assert_allclose(found.gyr, walk.gyr, rtol=rtol, atol=gyr_atol)


@pytest.mark.parametrize(
    ("mps2", "rad_s", "says"),
    [
        (0.001, 0.001, r"accelerations in mm/s\^2 .* and rates in mrad/s"),
        (0.01, math.radians(0.01), r"accelerations in (mg|cm/s\^2) and rates in deg/s/100.* or else --units acc="),
        (G / 1000, math.radians(0.1), r"accelerations in (mg|cm/s\^2) and rates in deg/s/10.* or else --units acc="),
    ],
)
def test_whole_numbers_of_decimal_units(mps2, rad_s, says, walk, ms, table):
    """Tell them from counts, and name the units with nearly the same |a|."""
    found = mpucal.load(table(HEADER, ms, np.rint(walk.acc / mps2), np.rint(walk.gyr / rad_s)))
    assert re.search(says, found.taken), found.taken
    same(found, walk, TWO_PERCENT, rad_s)


def test_whole_numbers_near_10000_for_1_g(walk, ms, table):
    """Read them in mm/s^2, and name the other unit; a column's name decides."""
    made = np.rint(walk.acc / (G / 10000))
    found = mpucal.load(table("ms,acc_x,acc_y,acc_z", ms, made))
    assert "in mm/s^2 (by |a|; if these are in 0.1 mg or counts, give --units acc=mg/10 or acc=counts)" in found.taken
    for names, hints in (("acc_x,acc_y,acc_z", {"units": "acc=mg/10"}), ("ax (0.1 mg),ay (0.1 mg),az (0.1 mg)", {})):
        np.testing.assert_allclose(mpucal.load(table(f"ms,{names}", ms, made), **hints).acc, G / 10000 * made)


@pytest.mark.parametrize(
    ("per_g", "says"),
    [
        (1000, "accelerations in mg and"),
        (980.665, "accelerations in cm/s^2 (by |a|; if these are in mg, give --units acc=mg)"),
        (1024, "accelerations in counts of ±32 g (by |a|; if these are in mg, give --units acc=mg)"),
    ],
)
def test_whole_numbers_near_1000_for_1_g(per_g, says, walk, ms, table):
    """Read them in the nearest unit, and name the other."""
    of_g = walk.acc / np.median(np.linalg.norm(walk.acc, axis=1))
    path = table("ms,acc_x,acc_y,acc_z", ms, np.rint(per_g * of_g))
    found = mpucal.load(path)
    assert says in found.taken
    np.testing.assert_allclose(found.acc, G * of_g, atol=0.01)
    np.testing.assert_allclose(mpucal.load(path, units="acc=mg").acc, G / 1000 * np.rint(per_g * of_g))


@pytest.mark.parametrize("per_g", [980, 1000, 1024])
def test_whole_mg_beside_mdeg(per_g, walk, ms, table):
    """Take these for the units of a driver, and a gain of 2 % for the sensor's."""
    of_g = walk.acc / np.median(np.linalg.norm(walk.acc, axis=1))
    path = table(HEADER, ms, np.rint(per_g * of_g), np.rint(1e3 * np.rad2deg(walk.gyr)))
    assert "accelerations in mg and rates in mdeg/s" in mpucal.load(path).taken


@pytest.mark.parametrize("orient", ["columns", "index"])
def test_pandas_json_with_times_as_its_index(orient, walk, tmp_path):
    made = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=NAMES, index=walk.t - walk.t[0])
    made.to_json(tmp_path / "a.json", orient=orient, double_precision=15)
    found = mpucal.load(tmp_path / "a.json")
    same(found, walk)
    np.testing.assert_allclose(np.diff(found.t), np.diff(walk.t), atol=1e-9)


def test_numbers_of_rows_are_no_times(walk, tmp_path):
    """Read pandas' own index, of which rows were dropped."""
    made = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=NAMES)
    made[::2].to_json(tmp_path / "a.json", double_precision=15)
    half = mpucal.load(tmp_path / "a.json", rate=50.0)
    np.testing.assert_allclose(half.acc, walk.acc[::2], atol=1e-9)
    np.testing.assert_allclose(half.gyr, walk.gyr[::2], atol=1e-9)


def test_columns_of_different_times_are_refused(walk, tmp_path):
    columns = {
        name: {str(at): x for at, x in zip((walk.t + 0.5 * (name[0] == "g")).tolist(), column.tolist(), strict=True)}
        for name, column in zip(NAMES, np.column_stack([walk.acc, walk.gyr]).T, strict=True)
    }
    (tmp_path / "a.json").write_text(json.dumps(columns))
    with pytest.raises(RecordingError, match="different indices"):
        mpucal.load(tmp_path / "a.json")


def test_packets_of_samples_in_json(walk, tmp_path):
    """Read one time and lists of samples for each packet, as of Movesense."""
    size = 8
    packets = [
        {
            "Timestamp": round(1e3 * float(walk.t[i])),
            "ArrayAcc": [dict(zip("xyz", row, strict=True)) for row in walk.acc[i : i + size].tolist()],
            "ArrayGyro": [dict(zip("xyz", row, strict=True)) for row in walk.gyr[i : i + size].tolist()],
        }
        for i in range(0, len(walk) - size + 1, size)
    ]
    (tmp_path / "a.json").write_text(json.dumps([{"data": {"imu": packet}} for packet in packets]))
    found = mpucal.load(tmp_path / "a.json", units="t=ms,gyr=rad/s")
    n = size * len(packets)
    np.testing.assert_allclose(found.acc, walk.acc[:n])


def test_two_lines_of_names_and_that_of_the_index(walk, tmp_path):
    names = pd.MultiIndex.from_product([["accel", "gyro"], list("xyz")])
    made = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=names, index=pd.Index(walk.t, name="time"))
    made.to_csv(tmp_path / "a.csv")
    same(mpucal.load(tmp_path / "a.csv"), walk)


def test_lines_of_a_value_called_by_its_path(walk, tmp_path):
    """Read Foxglove's export, in which linear_acceleration is ROS's and contains gravity."""
    paths = [f"/imu.{of}.{axis}" for of in ("linear_acceleration", "angular_velocity") for axis in "xyz"]
    samples = zip(walk.t.tolist(), np.column_stack([walk.acc, walk.gyr]).tolist(), strict=True)
    lines = [f"{t},{1e9 + t},{path},{of}" for t, row in samples for path, of in zip(paths, row, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["elapsed,receive_time,topic,value", *lines]) + "\n")
    same(mpucal.load(tmp_path / "a.csv"), walk)
