"""Tables whose lines are of several sensors: those of the first are read, whatever the column that tells them apart."""

import numpy as np
import pytest

import mpucal
from mpucal.files.tables import several
from mpucal.files.tables.table import Table

AXES = "ax,ay,az,gx,gy,gz"


def write(path, walk, header, labels, order="line"):
    """Write a line for each sample and board, whose axes point elsewhere; or the lines of a board after the other's."""
    turned = (np.eye(3), np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]))[: len(labels)]
    lines = [
        [
            f"{label},{t!r},{','.join(map(repr, [*(R @ a).tolist(), *(R @ w).tolist()]))}\n"
            for label, R in zip(labels, turned, strict=True)
        ]
        for t, a, w in zip(walk.t.tolist(), walk.acc, walk.gyr, strict=True)
    ]
    lines = lines if order == "line" else zip(*lines, strict=True)
    path.write_text(header + "".join(line for group in lines for line in group))


@pytest.mark.parametrize(
    ("header", "labels", "called"),
    [
        (f"channel,time,{AXES}\n", (0, 2, 5), "channel: 0, 2, 5"),
        (f"device,t,{AXES}\n", ("left", "right"), "device: left, right"),
        ("", (3, 4), "column 1: 3, 4"),
    ],
)
def test_lines_of_several_sensors_in_turn(header, labels, called, walk, assert_same, tmp_path):
    write(tmp_path / "boards.csv", walk, header, labels)
    found = mpucal.load(tmp_path / "boards.csv")
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert f"its lines are of several sensors ({called}), of which the first was read" in found.taken


def test_lines_of_one_sensor_after_the_other(walk, assert_same, tmp_path):
    """Read the first, and no interruption where the times of the next begin."""
    write(tmp_path / "boards.csv", walk, f"sensor_id,t,{AXES}\n", ("a", "b"), order="board")
    assert_same(mpucal.load(tmp_path / "boards.csv"), walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize("name", ["gait", "sensor"])
def test_a_column_that_tells_no_sensors_apart(name, walk, assert_same, tmp_path):
    """Read all lines where a column alternates on its own, or where the lines of one word lack a sensor."""
    words = np.where(np.arange(len(walk)) % 2, "swing", "stance")
    rows = zip(words.tolist(), walk.t.tolist(), walk.acc.tolist(), walk.gyr.tolist(), strict=True)
    text = f"{name},time,{AXES}\n"
    for word, t, acc, gyr in rows:
        if name == "gait":
            text += f"{word},{t!r},{','.join(map(repr, [*acc, *gyr]))}\n"
        else:
            text += f"acc,{t!r},{','.join(map(repr, acc))},,,\ngyr,{t!r},,,,{','.join(map(repr, gyr))}\n"
    (tmp_path / "walk.csv").write_text(text)
    assert_same(mpucal.load(tmp_path / "walk.csv"), walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize(
    ("name", "place"), [("Accel{}_{}", "right leg"), ("{1}_acc_{0}", "chest"), ("acc.{1}.{0}", "left")]
)
def test_columns_of_several_places(name, place, walk, assert_same, table):
    """Read the first IMU, whose columns another's precede, and mix no sensors of two."""
    of_place = [
        [
            name.replace("Accel", word).replace("acc", word).format(axis, at)
            for word in ("Accel", "Gyro")
            for axis in "XYZ"
        ]
        for at in (place.replace(" ", "_"), "hip")
    ]
    header = ["time", *of_place[0][:3], *of_place[1], *of_place[0][3:]]
    found = mpucal.load(table(",".join(header), walk.t, walk.acc, -walk.acc, walk.gyr + 1.0, walk.gyr))
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert f"of its columns, those called {place} were read" in found.taken


@pytest.mark.parametrize(
    ("of", "place"),
    [
        (("accelerometer_lsm6ds3_c.{}", "mag.{}", "linear_Acceleration.{}", "gyroscope_lsm6ds3_c.{}"), "lsm6ds3 c"),
        (("KX_imu_a{}", "imu_m{}", "euler_{}", "imu_g{}"), "KX"),
        (("Accel{}_high", "Mag{}", "v{}", "Gyro{}"), "high"),
    ],
)
def test_columns_with_a_chips_name(of, place, walk, assert_same, table):
    """Read them beside the linear acceleration of a phone, and where only the accelerometer has such a name."""
    header = ["timestamp", *(name.format(axis) for name in of for axis in "xyz")]
    made = table(",".join(header), walk.t, walk.acc, 0.1 * walk.acc, 0.2 * walk.gyr, walk.gyr)
    found = mpucal.load(made)
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert f"of its columns, those called {place} were read" in found.taken


def test_columns_of_no_axis_name_no_places(monkeypatch):
    """Search a wide table of other things only once for an IMU."""
    table = Table("wide", [f"mean_of_{number}_value" for number in range(300)], [])
    monkeypatch.setattr(several, "parse_header", lambda _header: pytest.fail("it was searched again"))
    assert several.of_one_place(table) is table
