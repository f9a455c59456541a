"""Files of other programs, damaged: an error of mpucal's, or a recording that is one."""

import contextlib
import io
import zipfile

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import mpucal


class Whole(dict):
    """Files that hypothesis need not print."""

    def __repr__(self):
        return "the whole files"


N, S = 120, 1_000_000_000


def table(walk):
    names = [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"] + [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"]
    made = pd.DataFrame(np.column_stack([walk.acc, walk.gyr]), columns=names)
    made.insert(0, "#timestamp [ns]", np.rint(walk.t * S).astype(np.int64))
    return made


@pytest.fixture(scope="module")
def files(walk, write_bag, tmp_path_factory):
    """suffix -> the bytes of a whole file."""
    folder = tmp_path_factory.mktemp("whole")
    some = walk.part(700, 700 + N)
    table(some).to_csv(folder / "a.csv", index=False)
    table(some).to_csv(folder / "a.tsv", index=False, sep="\t")
    table(some).to_parquet(folder / "a.parquet")
    table(some).to_json(folder / "a.json", orient="records")
    table(some).to_json(folder / "a.jsonl", orient="records", lines=True)
    counts = np.rint(np.column_stack([some.acc / 9.80665 * 16384, np.degrees(some.gyr) * 131])).astype(int)
    (folder / "a.txt").write_text("".join("a/g:\t" + "\t".join(map(str, row)) + "\n" for row in counts.tolist()))
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as file:
        for name, values in (("TotalAcceleration", some.acc), ("Gyroscope", some.gyr)):
            made = pd.DataFrame(np.column_stack([some.t, values]), columns=["seconds_elapsed", "x", "y", "z"])
            file.writestr(f"{name}.csv", made.to_csv(index=False))
    for kind in ("mcap", "db3", "bag"):
        bag = write_bag(folder / ("a.bag" if kind == "bag" else kind), some, np.rint(some.t * S).astype(int), kind)
        if kind != "bag":
            next(bag.glob(f"*.{kind}")).rename(folder / f"a.{kind}")
    return Whole({path.suffix: path.read_bytes() for path in folder.iterdir() if path.is_file()})


SUFFIXES = [".csv", ".tsv", ".json", ".jsonl", ".parquet", ".txt", ".zip", ".mcap", ".db3", ".bag"]
# damage of a file: cut, bytes changed, a piece twice, a piece gone, a piece of text put in
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
@settings(max_examples=30)
@given(damage=st.lists(DAMAGE, max_size=3))
@example(damage=[])
@example(damage=[("twice", 0.015625, b"\0"), ("gone", 0.5, b"\0")])  # of .mcap: no message is left
@example(damage=[("cut", 0.015625, b""), ("set", 0.0625, b"\0")])  # of .csv: one line is left, and no name of times
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
            assert damage
            assert str(error).endswith(".")
            return
    assert len(read) >= (2 if damage else N)
    assert (np.diff(read.t) > 0).all()
    assert np.isfinite(read.acc).all()
    # rates that nothing confirms are left out as a whole
    assert np.isfinite(read.gyr).all() or np.isnan(read.gyr).all()
