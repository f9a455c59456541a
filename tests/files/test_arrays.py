"""Arrays as programs and people keep them, in NumPy's, MATLAB's, Parquet's and JSON's files, read at the first try."""

import json
import struct
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

import mpucal
from mpucal.data import STANDARD_GRAVITY_MPS2 as G
from mpucal.errors import RecordingError


def si(walk):
    return np.column_stack([walk.acc, walk.gyr])


def as_fields(path, walk, ns):
    names = ("time_ms", "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "temperature")
    rows = np.column_stack([walk.t * 1000, si(walk), np.full(len(walk), 31.5)])
    np.save(path, np.array([tuple(row) for row in rows], [(name, "f8") for name in names]))


def as_matlabs_matrix(path, walk, ns):
    counts = np.rint(si(walk) * np.r_[[32768 / (4 * G)] * 3, [32750 / np.radians(500)] * 3])
    savemat(path, {"cal_data": np.column_stack([walk.t, counts, counts[:, :3] * 0.1])})


def frame(walk, **more):
    of = {f"acc_{axis}": walk.acc[:, i] / G for i, axis in enumerate("xyz")}
    return pd.DataFrame({**more, **of, **{f"gyr_{axis}": walk.gyr[:, i] for i, axis in enumerate("xyz")}})


def rows_of(walk, sign=1.0):
    return zip(walk.t.tolist(), (sign * si(walk)).tolist(), strict=True)


def of_axes(values):
    return dict(zip("xyz", values, strict=True))


def pairs(values):
    return [*map(list, of_axes(values).items())]


def in_text(values):
    return ", ".join(map(repr, values))


def edge_impulse(walk, **units):
    sensors = [
        {"name": f"{of}{axis}"} | ({"units": units[of]} if units else {}) for of in ("acc", "gyr") for axis in "XYZ"
    ]
    return {"payload": {"interval_ms": 10.0, "sensors": sensors, "values": si(walk).tolist()}}


def at_a_frequency(walk):
    """Hold many more values of another sensor, at another rate."""
    data = [{"gyroscope": row[3:], "acceleration": row[:3]} for _, row in rows_of(walk)]
    return {"at": "26/06/20", "emg": {"data": [[0] * 8] * 4000}, "imu": {"frequency": 100.0, "data": data}}


def of_sensor_logger(walk):
    """Return an object for each sensor and time, of text, with the axes backwards, beside one without gravity."""
    sensors = {"AccelerometerUncalibrated": walk.acc, "Accelerometer": walk.acc * 0.001, "Gyroscope": walk.gyr}
    return [
        {"sensor": of, "time": str(int(t * 1e9))}
        | {axis: str(values[k, i]) for i, axis in ((2, "z"), (1, "y"), (0, "x"))}
        for k, t in enumerate(walk.t)
        for of, values in sensors.items()
    ]


def as_hdf5(path, walk, ns):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["imu/t"], file["imu/acc"], file["imu/gyro"] = walk.t, walk.acc, walk.gyr


def as_mission_planner(path, walk, ns):
    """Write the log of two IMUs by turns, beside another message, with the columns' names in cells."""
    instance = np.zeros(len(walk))
    one = np.column_stack([2 * np.arange(len(walk)), np.rint(walk.t * 1e6), instance, walk.gyr, walk.acc, instance])
    other = np.column_stack([one[:, 0] + 1, one[:, 1], instance + 1, walk.gyr + 0.01, walk.acc + 0.02, instance])
    labels = {
        "RATE_label": np.array(["LineNo", "TimeUS", "R"], object),
        "IMU_label": np.array(["LineNo", "TimeUS", "I", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ", "EG"], object),
    }
    lines = np.stack([one, other], axis=1).reshape(-1, one.shape[1])
    savemat(path, {**labels, "RATE": np.tile(one[:, :3], (4, 1)), "IMU": lines})


def in_json(document):
    return lambda path, walk, ns: path.write_text(json.dumps(document(walk)))


# the file's name, what writes it there, and text of the recording's `taken`


def named(walk):
    """Return the samples under the names of mpucal's own tables."""
    columns = np.column_stack([walk.t, walk.acc, walk.gyr]).T.tolist()
    return dict(zip(["t", "ax", "ay", "az", "gx", "gy", "gz"], columns, strict=True))


WRITTEN = {
    "a matrix": ("a.npy", lambda p, w, ns: np.save(p, np.column_stack([w.t, si(w)])), "how gravity turns"),
    "fields": ("a.npy", as_fields, "times in ms"),
    "other names": (
        *("a.npz", lambda p, w, ns: np.savez(p, timestamps=w.t * 1e6, accel=w.acc.T / G, gyro=w.gyr, serial=[1, 2])),
        "accelerations in g",
    ),
    "a structure of MATLAB": (
        *("a.mat", lambda p, w, ns: savemat(p, {"imu": {"time": w.t, "acc": w.acc, "gyro": w.gyr}, "Fs": 100.0})),
        "times in s",
    ),
    "Mission Planner's log": ("a.mat", as_mission_planner, "of several sensors (imu: 0.0, 1.0)"),
    "a matrix of MATLAB without names": ("a.mat", as_matlabs_matrix, "counts of ±4 g"),
    "Parquet": ("a.parquet", lambda p, w, ns: frame(w, timestamp=ns).to_parquet(p), "accelerations in g"),
    "Feather": ("a.feather", lambda p, w, ns: frame(w, t=w.t).to_feather(p), "times in s"),
    "Parquet with dates": (
        *("a.parquet", lambda p, w, ns: frame(w, timestamp=pd.to_datetime(ns, utc=True)).to_parquet(p)),
        "times in ns",
    ),
    "Parquet with dates of no zone": (
        *("a.parquet", lambda p, w, ns: frame(w, timestamp=pd.to_datetime(ns)).to_parquet(p)),
        "times in ns",
    ),
    "Parquet with an index of dates": (
        *("a.parquet", lambda p, w, ns: frame(w).set_index(pd.to_datetime(ns, utc=True)).to_parquet(p)),
        "times in ns",
    ),
    "JSON's objects": (
        "a.json",
        in_json(
            lambda w: [{"t": t, "acc": dict(zip("xyz", r[:3], strict=True)), "gyro": r[3:]} for t, r in rows_of(w)]
        ),
        "times in s",
    ),
    "JSON's columns by pandas' index": (
        "a.json",
        in_json(lambda w: {of: {str(i): v for i, v in enumerate(values)} for of, values in named(w).items()}),
        "times in s",
    ),
    "JSON's columns": (
        "a.json",
        in_json(
            lambda w: {"imu": {"timestamp": w.t.tolist(), "accel": w.acc.tolist(), "gyro": w.gyr.tolist()}, "n": 3}
        ),
        "times in s",
    ),
    "Edge Impulse": ("a.json", in_json(lambda w: edge_impulse(w, acc="m/s2", gyr="rad/s")), "a rate of 100 Hz"),
    "Edge Impulse without units": ("a.json", in_json(edge_impulse), "a rate of 100 Hz"),
    "JSON of Sensor Logger": ("a.json", in_json(of_sensor_logger), "its lines of one time were joined"),
    "JSON's objects below their times": (
        "a.json",
        in_json(
            lambda w: {
                "data": [
                    {"t": t, "values": {"accelerometer": of_axes(r[:3]), "gyroscope": of_axes(r[3:])}}
                    for t, r in rows_of(w)
                ]
            }
        ),
        "times in s",
    ),
    "JSON of two IMUs": (
        "a.json",
        in_json(
            lambda w: {
                f"IMU{n}": [{"t": t, "acc": of_axes(r[:3]), "gyro": of_axes(r[3:])} for t, r in rows_of(w, sign)]
                for n, sign in ((1, 1.0), (2, -1.0))
            }
        ),
        "the accelerometer is IMU1.acc.x",
    ),
    "JSON's pairs of names and numbers": (
        "a.json",
        in_json(lambda w: [{"t": t, "acc": pairs(r[:3]), "gyro": pairs(r[3:])} for t, r in rows_of(w)]),
        "times in s",
    ),
    "JSON's texts of numbers": (
        "a.json",
        in_json(lambda w: [{"t": t, "acc": in_text(r[:3]), "gyro": in_text(r[3:])} for t, r in rows_of(w)]),
        "times in s",
    ),
    "JSON's lists of a time and a list": (
        "a.json",
        in_json(
            lambda w: {
                "accelerometer": [[t, r[:3]] for t, r in rows_of(w)],
                "gyroscope": [[t, r[3:]] for t, r in rows_of(w)],
            }
        ),
        "from accelerometer and gyroscope",
    ),
    "JSON's lists of lists": ("a.json", in_json(lambda w: [[t, r[:3], r[3:]] for t, r in rows_of(w)]), "guessed from"),
    "JSON's matrix of both": (
        *("a.json", in_json(lambda w: [{"time": t, "imu": [r[:3], r[3:]]} for t, r in rows_of(w)])),
        "guessed from",
    ),
    "MATLAB's matrices of times and axes": (
        "a.mat",
        lambda p, w, ns: savemat(p, {"acc": np.column_stack([w.t, w.acc]), "gyr": np.column_stack([w.t, w.gyr])}),
        "from acc and gyr",
    ),
    "HDF5": ("a.h5", as_hdf5, "times in s"),
    "a rate with all its digits": (
        *("a.npz", lambda p, w, ns: np.savez(p, acc=w.acc, gyr=w.gyr, sampling_rate=100.00000000000001)),
        "a rate of 100 Hz",
    ),
    "JSON at a frequency": ("a.json", in_json(at_a_frequency), "a rate of 100 Hz"),
    "an object on each line, of which the last is torn": (
        "a.jsonl",
        lambda p, w, ns: p.write_text(
            frame(w, t=w.t).to_json(orient="records", lines=True, double_precision=15) + '{"t'
        ),
        "times in s",
    ),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_arrays_are_read_at_the_first_try(name, walk, walk_ns, tmp_path):
    file, write, says = WRITTEN[name]
    write(tmp_path / file, walk, walk_ns)
    read = mpucal.load(tmp_path / file)
    np.testing.assert_allclose(read.t - read.t[0], walk.t, atol=1e-9)
    np.testing.assert_allclose(si(read), si(walk), atol=1.3e-3 if "counts" in read.taken else 1e-9)
    assert says in read.taken
    assert read.sensor.temperature_c == (31.5 if name == "fields" else None)
    assert (read.utc_ns == walk_ns[0]) == (name in ("Parquet", "Parquet with dates", "Parquet with an index of dates"))


def test_columns_of_a_data_frame_are_chosen_by_name(walk, walk_ns, assert_same, tmp_path):
    made = frame(walk, when=walk.t)
    made.columns = ["when", *"abcdef"]
    made[["when", *"adbecf"]].to_parquet(tmp_path / "walk.parquet")
    with pytest.raises(RecordingError, match="its columns are when, a, d, b, e, c, f"):
        mpucal.load(tmp_path / "walk.parquet")
    assert_same(mpucal.load(tmp_path / "walk.parquet", columns="t=when,ax=a,ay=b,az=c,gx=d,gy=e,gz=f"), walk)


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"acc": np.zeros((5, 3))}, "which is not gravity"),
        ({"note": "nothing"}, "holds no columns of numbers"),
        ({"data": np.random.default_rng(0).normal(size=(900, 7))}, "holds no three columns as long as gravity"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(arrays, says, tmp_path):
    savemat(tmp_path / "a.mat", arrays)
    with pytest.raises(RecordingError, match=says):
        mpucal.load(tmp_path / "a.mat")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        *((name, b"") for name in ("a.mat", "a.npy", "a.npz", "a.parquet")),
        ("a.mat", b"MATLAB 5.0 MAT-file"),
        ("a.mat", b"PK\x03\x04 and no more"),
        ("a.npy", b"\x93NUMPY\x01\x00"),
        ("a.npz", b"PK\x03\x04 and no more"),
        ("a.parquet", b"PAR1 and no more"),
        ("a.json", b"[1, 2" + b"," * 300),
        ("a.json", b"[" * 9000 + b"," * 300),
        ("a.json", b'{"rates": [1.0, "a", null]}'),
        ("a.json", b'{"acc": [' + b"1," * 300),
        ("a.json", b'{"values": [' + b",".join([b"[NaN,Infinity,1,2,3,4]"] * 300) + b"]}"),
    ],
)
def test_damaged_files_of_arrays_are_refused(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError):
        mpucal.load(tmp_path / name)


@pytest.mark.parametrize("indent", [None, 1])
def test_a_torn_file_of_a_pair_is_called_so(indent, walk, tmp_path):
    for name, values in (("acc", walk.acc), ("gyr", walk.gyr)):
        text = json.dumps(dict(zip("xyz", values.T.tolist(), strict=True)), indent=indent)
        (tmp_path / f"{name}.json").write_text(text if name == "gyr" else text[: len(text) // 2])
    with pytest.raises(RecordingError, match=r"acc.json is not a whole file of arrays .*: it is cut short or damaged"):
        mpucal.load(tmp_path / "gyr.json")


def test_a_calibration_is_no_recording(stored_calibration, tmp_path):
    stored_calibration[1].save(tmp_path / "calibration.json")
    with pytest.raises(RecordingError, match=r"mpucal knows: .* shows a calibration"):
        mpucal.load(tmp_path / "calibration.json")


def test_an_empty_file_is_called_empty(tmp_path):
    (tmp_path / "empty.json").touch()
    with pytest.raises(RecordingError, match="is empty: record it again"):
        mpucal.load(tmp_path / "empty.json")


@pytest.mark.parametrize("compressed", [False, True])
def test_a_damaged_file_of_matlab_is_an_error_or_a_recording(compressed, walk, tmp_path):
    """SciPy's reader crashes on some."""
    savemat(tmp_path / "a.mat", {"imu": {"acc": walk.acc[:50], "t": 1}, "m": [1, 2]}, do_compression=compressed)
    whole, rng = (tmp_path / "a.mat").read_bytes(), np.random.default_rng(2)
    for _ in range(100):
        damaged = bytearray(whole[: rng.integers(130, len(whole))] if rng.random() < 0.3 else whole)
        for at in rng.integers(100, min(len(damaged), 600), 3):
            damaged[at] = rng.integers(256)
        (tmp_path / "a.mat").write_bytes(damaged)
        with suppress(mpucal.MpucalError):
            mpucal.load(tmp_path / "a.mat")


HEAD_OF_7_3 = b"MATLAB 7.3 MAT-file, Platform: PCWIN64".ljust(124) + b"\0\2IM" + bytes(384)


def test_files_of_matlab_7_3_are_read_by_h5py(walk, assert_same, tmp_path):
    """Read two buffers of four rows, as a Simulink model keeps them."""
    h5py = pytest.importorskip("h5py")
    for name, values in (("accelerometer", walk.acc / G), ("gyroscope", np.degrees(walk.gyr))):
        path = tmp_path / f"mpu6050_{name}.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            file[f"{name}Buffer"] = np.vstack([walk.t, values.T]).T.copy()
        path.write_bytes(HEAD_OF_7_3 + path.read_bytes()[512:])
    for given in ("mpu6050_gyroscope.mat", "."):
        read = mpucal.load(tmp_path / given)
        assert "accelerations in g and rates in deg/s" in read.taken
        assert_same(read, walk)
    (tmp_path / "a.mat").write_bytes(HEAD_OF_7_3)
    # damaged files made the interpreter crash when it ended, after the message
    found = subprocess.run(
        [sys.executable, "-m", "mpucal", "show", "a.mat"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (found.returncode, "is not a whole file of arrays" in found.stderr) == (3, True), found


@pytest.mark.parametrize(
    ("name", "content", "extra"),
    [
        ("log.ulg", b"", "px4"),
        ("walk.parquet", b"", "parquet"),
        ("walk.bag", b"", "ros"),
        ("walk.db3", b"", "ros"),
        ("a.mat", HEAD_OF_7_3, "matlab"),
    ],
)
def test_a_library_that_is_missing_is_named(name, content, extra, tmp_path, monkeypatch):
    for module in ("pyulog", "pyarrow", "rosbags.highlevel", "h5py"):
        monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=rf"pip install 'mpucal\[{extra}\]'"):
        mpucal.load(tmp_path / name)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8 if kind != 15 else 0)


def matrix(of, shape, name, *parts):
    """Return a matrix of the class `of`; see MAT-File Format."""
    said = element(6, struct.pack("<II", of, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, said + element(1, name) + b"".join(parts))


def numbers(values):
    return matrix(6, (len(values), 1), b"", element(9, np.asarray(values, float).tobytes()))


def cells(*parts):
    return matrix(1, (len(parts), 1), b"", *parts)


def fields(**values):
    names = b"".join(name.encode().ljust(16, b"\0") for name in values)
    head = element(5, struct.pack("<i", 16)) + element(1, names)
    return matrix(2, (1, 1), b"", head, *values.values())


def thing(name, kind, value):
    said = element(6, struct.pack("<II", 17, 0)) + b"".join(element(1, word) for word in (name, b"MCOS", kind))
    return element(14, said + value)


HEAD_OF_5 = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"


def test_objects_of_matlab_are_named(tmp_path):
    """Name the commands of MATLAB that write them as tables, unless arrays of numbers stand beside them."""
    tables = b"".join(thing(name, b"timeseries", numbers([1.0, 2.0])) for name in (b"acc", b"gyro"))
    (tmp_path / "log.mat").write_bytes(HEAD_OF_5 + tables)
    with pytest.raises(RecordingError, match=r"acc is a timeseries, gyro is a timeseries") as refused:
        mpucal.load(tmp_path / "log.mat")
    writes = "writetimetable(timeseries2timetable({0}), '{0}.csv')"
    assert f"`load log.mat; {writes.format('acc')}; {writes.format('gyro')}`, and give the folder" in str(refused.value)
