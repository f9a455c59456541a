"""Tables whose lines are of several sensors: those of the first are read, whatever the column that tells them apart."""

import shlex

import numpy as np
import pytest

import mpucal
from mpucal.errors import RecordingError
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
    """Read the first, without an interruption where the times of the next sensor begin."""
    write(tmp_path / "boards.csv", walk, f"sensor_id,t,{AXES}\n", ("a", "b"), order="board")
    assert_same(mpucal.load(tmp_path / "boards.csv"), walk, 1e-9, 1e-9, 1e-9)


@pytest.mark.parametrize("name", ["gait", "sensor"])
def test_a_column_that_tells_no_sensors_apart(name, walk, assert_same, tmp_path):
    """Read all lines if a column alternates by itself, or if the lines with one of its words lack a sensor."""
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
    """Read the IMU of the first column, with another's columns among its own, and do not mix the two."""
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
        (("IMU_ATTI(0):accel{}", "IMU_ATTI(0):mag{}", "RC:stick{}", "IMU_ATTI(0):gyro{}"), ""),
    ],
)
def test_columns_with_a_chips_name(of, place, walk, assert_same, table):
    """Read them beside the linear acceleration of a phone, and where only the accelerometer has such a name."""
    header = ["timestamp", *(name.format(axis) for name in of for axis in "xyz")]
    made = table(",".join(header), walk.t, walk.acc, 0.1 * walk.acc, 0.2 * walk.gyr, walk.gyr)
    found = mpucal.load(made)
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert not place or f"of its columns, those called {place} were read" in found.taken


def test_columns_of_no_axis_name_no_places(monkeypatch):
    """Search a wide table of other things only once for an IMU."""
    table = Table("wide", [f"mean_of_{number}_value" for number in range(300)], [])
    monkeypatch.setattr(several, "parse_header", lambda _header: pytest.fail("it was searched again"))
    assert several.of_one_place(table) is table


def lines_of_two(walk, line):
    """Return lines of two boards by turns, of which the second is upside down; `line` names the samples' numbers."""
    both = (np.eye(3), np.diag([1.0, -1.0, -1.0]))
    return "".join(
        line(number, [*(R @ a).tolist(), *(R @ w).tolist()], t)
        for t, a, w in zip(walk.t.tolist(), walk.acc, walk.gyr, strict=True)
        for number, R in enumerate(both)
    )


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("0x6{2} accel: {0} gyro: {1}\n", ("0x68", "0x69")),
        ("[IMU{2}] t={3} acc=({0}) gyr=({1})\n", ("IMU8", "IMU9")),
        ("IMU{2}: {3!r},{0},{1}\n", ("IMU8", "IMU9")),
        ("Sensor {2}:\nAccel: {0}\nGyro: {1}\nTime: {3}\n", ("Sensor 8", "Sensor 9")),
    ],
)
def test_lines_that_begin_with_their_sensor(line, names, walk, tmp_path):
    """Read the first, or the one that --sensor names; a refusal names those that there are."""
    walk = walk.part(0, 400)

    def one(number, values, t):
        acc, gyr = (", ".join(map(repr, of)) for of in (values[:3], values[3:]))
        return line.format(acc, gyr, 8 + number, t)

    (tmp_path / "boards.log").write_text("boot\n" + lines_of_two(walk, one))
    first, second = (mpucal.load(tmp_path / "boards.log", sensor=name) for name in (None, names[1].lower()))
    np.testing.assert_allclose(first.acc, walk.acc, rtol=0, atol=1e-9)
    np.testing.assert_allclose(second.acc, walk.acc * [1, -1, -1], rtol=0, atol=1e-9)
    assert f"({', '.join(names)}), of which the first was read (--sensor chooses)" in first.taken
    with pytest.raises(RecordingError, match=f"no sensor called 0x70; its sensors are {', '.join(names)}") as refused:
        mpucal.load(tmp_path / "boards.log", sensor="0x70")
    assert mpucal.load(tmp_path / "boards.log", sensor=shlex.split(refused.value.options)[1]).taken == first.taken


def test_a_coarse_field_that_alternates_names_no_sensor(walk, table, assert_same):
    """Do not take few values of another quantity, such as a magnetic field, for the names of sensors."""
    field = np.array([0.25, -0.5, 0.75])[np.arange(len(walk)) % 3]
    shift = np.where(np.arange(len(walk)) % 3, 0.0, 1.0)
    found = mpucal.load(table(f"time,{AXES},mag,p,q,r", walk.t, walk.acc, walk.gyr, field, shift, shift, shift))
    assert_same(found, walk)


@pytest.mark.parametrize("name", ["t", "time"])
def test_lines_by_turns_that_nothing_names(name, walk, assert_same, tmp_path):
    """Refuse them, under our own names of columns, too; the option in the message reads the first."""
    path = tmp_path / "boards.csv"
    path.write_text(f"{name},{AXES}\n" + lines_of_two(walk, lambda _, of, t: f"{t!r},{','.join(map(repr, of))}\n"))
    with pytest.raises(
        RecordingError, match=r"2 sensors that take turns, .* choose one with --sensor 1 or 2"
    ) as refused:
        mpucal.load(path)
    assert refused.value.options == "--sensor 1"
    assert_same(mpucal.load(path, sensor="1"), walk, 1e-9, 1e-9, 1e-9)
    np.testing.assert_allclose(mpucal.load(path, sensor="2").acc, walk.acc * [1, -1, -1], rtol=0, atol=1e-9)


def test_a_sensor_of_a_table_of_one(walk, table):
    """Refuse a name where nothing tells sensors apart; a vibration whose direction alternates is of one sensor."""
    path = table(f"time,{AXES}", walk.t, walk.acc, walk.gyr)
    with pytest.raises(RecordingError, match="nothing tells several sensors apart: leave out --sensor"):
        mpucal.load(path, sensor="2")
    shaken = walk.acc + np.outer((-1.0) ** np.arange(len(walk)), [4.0, 1.0, 3.0])
    assert len(mpucal.load(table(f"time,{AXES}", walk.t, shaken, walk.gyr))) == len(walk)


@pytest.mark.parametrize(
    ("name", "words", "second"),
    [("{0}{2}{1}", ("a", "g"), "2"), ("{0}{1}_{2}", ("acc", "gyro"), "2"), ("imu{1}_{0}_{2}", ("acc", "gyr"), "imu2")],
)
def test_columns_of_a_numbered_imu(name, words, second, walk, assert_same, table):
    """Read the columns of the first, or of the one that --sensor names."""
    header = [name.format(word, number, axis) for number in (1, 2) for word in words for axis in "xyz"]
    path = table(",".join(["time", *header]), walk.t, walk.acc[:, ::-1], -walk.gyr[:, ::-1], walk.acc, walk.gyr)
    assert_same(mpucal.load(path, sensor=second), walk, 1e-9, 1e-9, 1e-9)
    np.testing.assert_allclose(mpucal.load(path).acc, walk.acc[:, ::-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "late"), [("id", 0.0005), ("id", 0.005), ("foot", 0.0), ("foot", 0.0003)])
def test_lines_of_two_sensors_that_read_alike(name, late, walk, assert_same, tmp_path):
    """Read one of two in the same orientation, by a column called id, or as their lines come together."""
    lines = (
        f"{word},{t + late * (word == 'right')!r},{','.join(map(repr, [*a.tolist(), *w.tolist()]))}\n"
        for t, a, w in zip(walk.t.tolist(), walk.acc, walk.gyr, strict=True)
        for word in ("left", "right")
    )
    path = tmp_path / "boards.csv"
    path.write_text(f"{name},time,{AXES}\n" + "".join(lines))
    found = mpucal.load(path, sensor="right")
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert f"({name}: left, right), of which right was read" in found.taken
    assert "of which the first was read" in mpucal.load(path).taken


def test_a_word_that_the_user_calls_a_sensor(walk, assert_same, tmp_path):
    """Read the lines with the given word in a column of text, which are in one piece."""
    write(tmp_path / "boards.csv", walk, f"trial,time,{AXES}\n", ("a", "b"), order="board")
    assert_same(mpucal.load(tmp_path / "boards.csv", sensor="a"), walk, 1e-9, 1e-9, 1e-9)


def test_a_place_that_is_one_word_with_its_axis(walk, assert_same, table):
    columns = [f"{place}{axis}" for place in ("Right", "Left") for axis in AXES.split(",")]
    found = mpucal.load(table(f"time,{','.join(columns)}", walk.t, walk.acc, walk.gyr, -walk.acc, walk.gyr))
    assert_same(found, walk, 1e-9, 1e-9, 1e-9)
    assert "--sensor chooses of Right, Left" in found.taken
