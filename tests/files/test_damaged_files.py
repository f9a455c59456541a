"""Files of other programs, damaged: an error of mpucal's, or a recording that is one."""

import contextlib
import io
import zipfile

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

import mpucal


class Whole(dict):
    """Files that hypothesis need not print."""

    def __repr__(self):
        return "the whole files"


N, S = 120, 1_000_000_000
IMU = "sensor_msgs/msg/Imu"


def table(walk):
    names = [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"] + [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"]
    made = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=names)
    made.insert(0, "#timestamp [ns]", np.rint(walk.t * S).astype(np.int64))
    return made


def archive(walk, folder):
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as file:
        for name, values in (("Accelerometer", walk.acc), ("Gyroscope", walk.gyr)):
            made = pd.DataFrame(values, columns=["x", "y", "z"])
            made.insert(0, "seconds_elapsed", walk.t)
            file.writestr(f"{name}.csv", made.to_csv(index=False))


def bag(walk, folder, kind):
    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.SQLITE3 if kind == "db3" else StoragePlugin.MCAP
    writer = Writer1(folder / "a.bag") if kind == "bag" else Writer2(folder / kind, version=9, storage_plugin=plugin)
    kinds, zeros = store.types, np.zeros(9)
    vector = kinds["geometry_msgs/msg/Vector3"]
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=store)
        for t, acc, gyr in zip(walk.t.tolist(), walk.acc.tolist(), walk.gyr.tolist(), strict=True):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=int(t), nanosec=int(t % 1 * S))
            head = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **({"seq": 0} if kind == "bag" else {}))
            turned = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
            made = kinds[IMU](head, turned, zeros, vector(*gyr), zeros, vector(*acc), zeros)
            serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
            writer.write(connection, int(t * S), serialize(made, IMU))
    if kind != "bag":
        made = next(path for path in (folder / kind).iterdir() if path.suffix != ".yaml")
        made.rename(folder / f"a.{kind}")


@pytest.fixture(scope="module")
def files(walk, tmp_path_factory):
    """suffix -> the bytes of a whole file."""
    folder = tmp_path_factory.mktemp("whole")
    some = walk.part(1000, 1000 + N)
    table(some).to_csv(folder / "a.csv", index=False)
    table(some).to_csv(folder / "a.tsv", index=False, sep="\t")
    table(some).to_parquet(folder / "a.parquet")
    counts = np.rint(np.column_stack([some.acc / 9.80665 * 16384, np.degrees(some.gyr) * 131])).astype(int)
    (folder / "a.txt").write_text("".join("a/g:\t" + "\t".join(map(str, row)) + "\n" for row in counts.tolist()))
    archive(some, folder)
    for kind in ("mcap", "db3", "bag"):
        bag(some, folder, kind)
    return Whole({path.suffix: path.read_bytes() for path in folder.iterdir() if path.is_file()})


SUFFIXES = [".csv", ".tsv", ".parquet", ".txt", ".zip", ".mcap", ".db3", ".bag"]
# what befalls a file: cut, bytes changed, a piece twice, a piece gone, a piece of text put in
PLACES = st.floats(0, 1, exclude_max=True)
DAMAGE = st.one_of(
    st.tuples(st.just("cut"), PLACES, st.just(b"")),
    st.tuples(st.just("set"), PLACES, st.binary(min_size=1, max_size=8)),
    st.tuples(st.just("twice"), PLACES, st.binary(min_size=1, max_size=60)),
    st.tuples(st.just("gone"), PLACES, st.binary(min_size=1, max_size=60)),
    st.tuples(
        st.just("put"), PLACES, st.sampled_from([b"nan", b"1e999", b";", b",", b'"', b"\n", b"-", b"\0", b"\xff"])
    ),
)


def damaged(data, kind, place, with_):
    at = int(place * len(data))
    end = at + len(with_)
    return {
        "cut": data[:at],
        "set": data[:at] + with_ + data[end:],
        "twice": data[:end] + data[at:],
        "gone": data[:at] + data[end:],
        "put": data[:at] + with_ + data[at:],
    }[kind]


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=40)
@given(damage=st.lists(DAMAGE, min_size=1, max_size=3))
@example(damage=[("twice", 0.015625, b"\0"), ("gone", 0.5, b"\0")])  # of .mcap: no message is left
def test_a_damaged_file_is_refused_or_read(suffix, damage, files, tmp_path):
    data = files[suffix]
    for one in damage:
        data = damaged(data, *one)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data)
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            read = mpucal.load(path, rate=100 if suffix == ".txt" else None)
        except mpucal.MpucalError as error:
            assert str(error).endswith(".")
            return
    assert len(read) >= 2
    assert (np.diff(read.t) > 0).all()
    assert np.isfinite(read.acc).all()
    assert np.isfinite(read.gyr).all()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_whole_file_is_read(suffix, files, tmp_path):
    (tmp_path / f"a{suffix}").write_bytes(files[suffix])
    assert len(mpucal.load(tmp_path / f"a{suffix}", rate=100 if suffix == ".txt" else None)) == N
