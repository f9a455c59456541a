"""A small file that holds, or says that it holds, more than may be taken."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import mpucal
from mpucal.errors import RecordingError
from mpucal.files import mcap, open_rows, reading

FIXTURES = Path(__file__).parents[2] / "fixtures"


def archive(path, n, **more):
    still = {"t": np.arange(n) / 100, "acc": np.tile([0.0, 0.0, 9.8], (n, 1)), "gyr": np.zeros((n, 3))}
    np.savez_compressed(path, **still, **more)


def test_an_archive_of_zeros_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    archive(tmp_path / "zeros.npz", 40_000)
    archive(tmp_path / "more.npz", 100, more=np.zeros(200_000))
    monkeypatch.setenv(reading.VARIABLE, "1")
    with pytest.raises(RecordingError, match=r"takes 2 MB, but only 1 MB are allowed.*--most-mb"):
        mpucal.load(tmp_path / "zeros.npz")
    # an array that is not asked for is not unpacked
    assert len(mpucal.load(tmp_path / "more.npz")) == 100


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others do not count all memory")
def test_reading_is_stopped_at_the_memory_limit_except_in_threads_of_a_caller(tmp_path, monkeypatch):
    import resource

    def limited():
        with reading.limit_memory(tmp_path / "a.csv"):
            return resource.getrlimit(resource.RLIMIT_DATA) != before

    before = resource.getrlimit(resource.RLIMIT_DATA)
    monkeypatch.delenv(reading.VARIABLE, raising=False)
    with ThreadPoolExecutor(1) as other:
        assert not other.submit(limited).result()
        monkeypatch.setenv(reading.VARIABLE, "64")
        assert other.submit(limited).result()
    with pytest.raises(RecordingError, match=r"a\.csv takes more than 64 MB"), reading.limit_memory(tmp_path / "a.csv"):
        bytearray(128 << 20)
    assert resource.getrlimit(resource.RLIMIT_DATA) == before


def test_a_chunk_that_is_longer_than_chunks_are_is_not_unpacked(monkeypatch):
    monkeypatch.setattr(mcap, "LONGEST_CHUNK", 1000)
    capture = mcap.read_capture(FIXTURES / "sessions" / "enter.mcap")
    assert "damaged" in capture.recovered
    assert capture.records == ()


def test_a_line_without_an_end_is_refused(tmp_path):
    (tmp_path / "long.csv").write_bytes(b"t,ax,ay,az,gx,gy,gz\n" + b"1" * (8 << 20))
    with pytest.raises(RecordingError, match="a line of more than 1 MB"):
        list(open_rows(tmp_path / "long.csv").runs)


def test_a_file_far_longer_than_memory_is_not_read_whole(tmp_path):
    for ending in ("csv", "tlog", "ulg", "log"):
        with (tmp_path / f"sparse.{ending}").open("wb") as file:
            file.write(b"t,ax,ay,az,gx,gy,gz\n")
            file.truncate(50 << 30)
        with pytest.raises(RecordingError, match="takes 51200 MB"):
            mpucal.load(tmp_path / f"sparse.{ending}")
