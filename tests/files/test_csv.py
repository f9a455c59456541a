import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mpucal.data import Recording
from mpucal.errors import OutputError, RecordingError
from mpucal.files import load, open_rows

finite = st.floats(-1e9, 1e9)
HEADER = "t,ax,ay,az,gx,gy,gz\n"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "made.csv"


@settings(max_examples=30)
@given(arrays(float, (4, 6), elements=finite), st.none() | arrays(float, 4, elements=finite))
def test_reads_the_same_numbers_that_were_saved(save, path, values, temperature_c):
    recording = Recording.from_arrays([0.0, 0.1, 0.2, 1 / 3], values[:, :3], values[:, 3:], temperature_c=temperature_c)
    save(recording, path)
    read = load(path)
    for name in ("t", "acc", "gyr", "temperature_c"):
        np.testing.assert_array_equal(getattr(read, name), getattr(recording, name))
    assert read.name == "made.csv"


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("t,ax,ay,az,gx,gy,gz\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n", id="as documented"),
        pytest.param("gz,t,gx,note,ay,ax,az,gy\n6,0,4,a,2,1,3,5\n6,1,4,b,2,1,3,5\n", id="another order, one more"),
        pytest.param("\ufeffT, Ax, AY ,az,gx,gy,gz\r\n0,1,2,3,4,5,6\r\n\r\n1, 1,2,3,4,5,6", id="a spreadsheet's"),
        pytest.param('"t","ax","ay","az","gx","gy","gz"\n"0",1,2,3,4,5,6\n"1",1,2,3,4,5,6\n,,,,,,\n', id="quoted"),
        pytest.param("t,ax,ay,az,gx,gy,gz\r0,1,2,3,4,5,6\r1,1,2,3,4,5,6\r", id="an old Macintosh's"),
        pytest.param("t,ax,ay,az,gx,gy,gz\n  \n0,1,2,3,4,5,6\n \t\n1,1,2,3,4,5,6\n  ", id="lines of blanks"),
    ],
)
def test_columns_go_by_their_names(path, text):
    path.write_text(text, newline="")
    read = load(path)
    np.testing.assert_array_equal(read.t, [0, 1])
    np.testing.assert_array_equal(read.acc, [[1, 2, 3]] * 2)
    np.testing.assert_array_equal(read.gyr, [[4, 5, 6]] * 2)
    assert np.isnan(read.temperature_c).all()
    (rows,) = open_rows(path).runs
    np.testing.assert_array_equal(np.column_stack([rows.t, rows.acc, rows.gyr]), [[0, *range(1, 7)], [1, *range(1, 7)]])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        pytest.param("", "is empty", id="empty"),
        pytest.param("\n\n", "is empty", id="blank"),
        pytest.param(HEADER, "holds no samples", id="header alone"),
        pytest.param("0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n", "its columns are unnamed: name its columns", id="no header"),
        pytest.param("t,ax,ay,az,gx,gy\n", "holds no lines below", id="no gz"),
        pytest.param("t;ax;ay;az;gx;gy;gz\n0;1;2;3;4;5;6\n", "holds 1 accelerations", id="semicolons"),
        pytest.param("t,t,ax,ay,az,gx,gy,gz\n", "names t twice", id="t twice"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n\n1,1,2,3,4,5\n", "line 4 has 6 values", id="a value short"),
        pytest.param(HEADER + "0,1,2,3,4,5,6,7\n", "line 2 has 8 values", id="a value more"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n1,1,2,x,4,5,6\n", "line 3: az is 'x'", id="a word"),
        pytest.param(HEADER + "0,1,2,,4,5,6\n", "lacks a number in every sample", id="nothing"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n1,1,nan,3,4,5,6\n", "lacks a number in nearly every", id="NaN"),
        pytest.param(HEADER + "1,1,2,3,4,5,6\n0,1,2,3,4,5,6\n", "time does not increase", id="time runs back"),
        pytest.param(HEADER + "0,1,2,3,4,5,6\n", r"shape \(1,\)", id="one sample"),
        pytest.param(HEADER + '0,"' + "1" * 200_000, "line 2 is not a line", id="a field without end"),
    ],
)
def test_tables_that_are_no_recording(path, text, says):
    path.write_text(text)
    with pytest.raises(RecordingError, match=says) as raised:
        load(path)
    assert "made.csv" in str(raised.value)


def test_files_that_are_no_table(save, path, tmp_path):
    path.write_bytes(b"\x89MCAP0\r\n\xff\xfe")
    with pytest.raises(RecordingError, match="names no columns of"):
        load(path)
    with pytest.raises(RecordingError, match="there is no file"):
        load(tmp_path / "none.csv")
    with pytest.raises(OutputError):
        save(Recording.from_arrays([0, 1], np.zeros((2, 3)), np.zeros((2, 3))), tmp_path / "none" / "made.csv")
