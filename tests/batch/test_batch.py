"""A batch on worker processes, compared with the same rows made one by one in this process."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest

import mpucal.batch
from mpucal.__main__ import run as call
from mpucal.batch.journal import RowJournal
from mpucal.batch.locations import expand
from mpucal.batch.many import local_client, run_batch
from mpucal.batch.page import make_page
from mpucal.batch.row import COLUMNS, Settings, make_row
from mpucal.batch.table import escape_cell, make_table, write_tables
from mpucal.errors import OutputError
from mpucal.result.calibration import Calibration

FIXTURES = Path(__file__).parents[2] / "fixtures"
SETTINGS = Settings("accel", 9.80665)
LONG_S = 60


def changed(settings):
    """Return a context with changed settings of dask."""
    import dask
    import distributed  # noqa: F401  what is set before its settings are loaded takes them along when it is put back

    return dask.config.set(settings)


@pytest.fixture(scope="module")
def client():
    """A worker, a process of its own, and a client of its scheduler."""
    with local_client(1) as client:
        yield client


@pytest.fixture
def captures(tmp_path):
    """Folder of a production line: two sessions of one sensor, short captures, junk, a cut file and a missing one."""
    folder = tmp_path / "line-3"
    folder.mkdir()
    for name in ("mpu6050", "mpu6500"):
        shutil.copy(FIXTURES / "sessions" / f"{name}.mcap", folder)
    shutil.copytree(FIXTURES / "faults", folder / "more")
    (folder / "junk.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(range(256)))
    (folder / "cut.mcap").write_bytes((FIXTURES / "sessions" / "mpu6050.mcap").read_bytes()[:50_000])
    return [*map(str, sorted(folder.rglob("*.mcap"))), str(folder / "none.mcap")]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_row_for_which_there_is_no_space_ends_in_a_sentence(tmp_path):
    journal = RowJournal(tmp_path / "rows.jsonl", SETTINGS.key)
    os.dup2(os.open("/dev/full", os.O_WRONLY), journal._file.fileno())
    with pytest.raises(OutputError, match=r"rows\.jsonl \(No space left on device\): free space there"):
        journal.add({"path": "a.mcap"})
    journal.close()


def test_a_worker_is_killed_and_then_the_program(client, captures, tmp_path):
    expected = make_table(make_row(path, SETTINGS) for path in captures)
    errors = [error for error in expected["error"].to_pylist() if error]
    assert len(errors) >= 2
    assert not any("bug" in error for error in errors)
    journal = RowJournal(tmp_path / "rows.jsonl", SETTINGS.key)
    first = min(client.run(os.getpid).values())
    for progress in run_batch(captures, client, journal, SETTINGS):
        if progress.done == 2:
            os.kill(first, signal.SIGKILL)
    assert (progress.done, progress.kept) == (len(captures), 0)
    assert make_table(journal.rows(captures)).equals(expected)
    journal.close()
    # a row cut by a kill of the program, and a capture that was changed later
    with (tmp_path / "rows.jsonl").open("ab") as file:
        file.write(b'{"settings": "')
    journal = RowJournal(tmp_path / "rows.jsonl", SETTINGS.key)
    Path(captures[0]).write_bytes(Path(captures[1]).read_bytes())
    *_, progress = run_batch(captures, client, journal, SETTINGS)
    # only changed and unreadable captures are calibrated again
    assert progress.kept == len(captures) - 1 - errors.count(expected["error"][-1].as_py())
    again = make_table(journal.rows(captures))
    assert again.slice(1).equals(expected.slice(1))
    assert again["digest"][0] == again["digest"][1]
    journal.close()


# loaded by each worker: one path kills it
MORTAL = """
import os
from mpucal.batch import row

compute_digest = row.compute_digest
row.compute_digest = lambda path: os._exit(1) if path.stem == "deadly" else compute_digest(path)
"""


# if the worker died during an answer, the client lost its scheduler in one run of all tests in eight
@pytest.mark.slow
def test_a_recording_that_kills_workers_is_told_from_the_others_of_its_task(tmp_path):
    """A task holds several recordings; if its worker is killed, each of them is tried alone."""
    paths = [f"/none/{i}.mcap" for i in range(100)]
    paths[40] = "/none/deadly.mcap"
    journal = RowJournal(tmp_path / "rows.jsonl", SETTINGS.key)
    (mortal := tmp_path / "mortal.py").write_text(MORTAL)
    config = {"distributed.scheduler.allowed-failures": 0, "distributed.worker.preload": [str(mortal)]}
    with changed(config), local_client(3) as client:
        *_, progress = run_batch(paths, client, journal, SETTINGS)
    assert (progress.done, progress.failed) == (100, 100)
    errors = [row["error"] for row in journal.rows(paths)]
    assert "workers died" in errors[40]
    assert sum("workers died" in error for error in errors) == 1
    journal.close()


@pytest.mark.slow  # the gate tests workers that are killed while they start
def test_a_worker_that_comes_back_late_is_waited_for():
    """Wait for a killed worker to be started again, though the time limit of dask is 0 s here."""
    with changed({"distributed.deploy.lost-worker-timeout": "0 s"}), local_client(1) as client:
        (first,) = client.run(os.getpid).values()
        os.kill(first, signal.SIGKILL)
        begun = monotonic()
        while not set(client.run(os.getpid, on_error="ignore").values()) - {first} and monotonic() - begun < LONG_S:
            sleep(0.1)
        client.wait_for_workers(1, timeout=1)


def test_the_command_writes_a_table_and_a_page(client, captures, tmp_path, capsys, monkeypatch):
    import pyarrow.parquet as pq

    monkeypatch.chdir(tmp_path)
    words = ["batch", str(tmp_path / "line-3" / "*.mcap"), "-o", "fleet", "--model", "accel", "--reports"]
    assert call([*words, "--scheduler", client.scheduler.address]) == 0
    printed = capsys.readouterr()
    assert re.search(r"4 of 4, .* a second, 1 unreadable", printed.err)
    columns = pq.read_table("fleet/results.parquet").to_pydict()
    with Path("fleet/results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["path"] for row in rows] == columns["path"] == sorted(columns["path"])
    assert tuple(rows[0]) == tuple(columns) == COLUMNS
    assert set(columns["batch"]) == {"line-3"}
    assert call(["calibrate", columns["path"][2], "--model", "accel", "-o", "one"]) in (0, 5)
    one = Calibration.load("one/calibration.json")
    assert [columns[f"b_a_{axis}"][2] for axis in "xyz"] == one.b_a.tolist()
    assert [float(rows[2][f"D_x{axis}"]) for axis in "xyz"] == one.D[0].tolist()
    html = Path("fleet/fleet.html").read_text()
    links = re.findall(r'href="(reports/[^"]*)"', html)
    assert len(links) == sum(report is not None for report in columns["report"])
    assert all((Path("fleet") / link).exists() for link in links)


def test_urls_are_read_where_the_worker_is(captures):
    import fsspec

    there = fsspec.filesystem("memory")
    path = next(path for path in captures if "mpu6050" in path)
    there.pipe("/line/mpu6050.mcap", Path(path).read_bytes())
    here, far = make_row(path, SETTINGS), make_row("memory://line/mpu6050.mcap", SETTINGS)
    assert far["batch"] == "line"
    assert {**far, "path": "", "batch": ""} == {**here, "path": "", "batch": ""}
    assert "cannot fetch memory://line/none.mcap" in make_row("memory://line/none.mcap", SETTINGS)["error"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_among_the_recordings_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "walk.csv")
    assert "is a pipe or device" in make_row(str(tmp_path / "walk.csv"), SETTINGS)["error"]


def test_a_url_that_nothing_can_read_says_what_is_lacking(monkeypatch):
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    monkeypatch.delitem(sys.modules, "fsspec.implementations.http", raising=False)
    for url in ("http://127.0.0.1:9/a.mcap", "https://127.0.0.1:9/a.mcap"):
        assert "pip install 'fsspec[http]'" in make_row(url, SETTINGS)["error"]
    with pytest.raises(mpucal.MpucalError, match=r"cannot list .* pip install 'fsspec\[http\]'"):
        expand(["http://127.0.0.1:9/*.mcap"])
    signed = "https://bucket.example/a.mcap?signature=1*2"
    assert expand([signed]) == [signed]


def test_the_page_names_what_is_odd(tmp_path):
    """Calibrate each of some made-up boards twice: one is far from the others, one is refused."""
    rng, rows = np.random.default_rng(3), []
    for board in range(200):
        b_a = rng.normal(0.0, 0.1, 3) + (2.0 if board == 77 else 0.0)
        for again in range(2):
            row = {"path": f"b{board}-{again}.mcap", "digest": f"{board}-{again}"}
            row |= {"batch": f"day-{again}", "sensor": f"{board}", "report": f"r{board}-{again}.html"}
            row |= {"who_am_i": 0x68, "temperature_c": 20.0 + 10 * again}
            row |= (
                {"verdict": "refused", "reasons": "never_still"} if board == 3 else {"verdict": "good", "reasons": ""}
            )
            row |= {f"D_{i}{j}": float(i == j) for i in "xyz" for j in "xyz"}
            row |= {f"b_a_{axis}": b_a[k] + rng.normal(0.0, 0.01) for k, axis in enumerate("xyz")}
            row |= {f"b_a_std_{axis}": 0.01 for axis in "xyz"}
            rows.append(row)
    parquet, _ = write_tables(tmp_path, iter(rows))
    html, _ = make_page(parquet)
    outliers = html[html.index('id="outliers"') : html.index("By batch")]
    assert set(re.findall(r"b\d+-\d\.mcap", outliers)) == {"b77-0.mcap", "b77-1.mcap"}
    assert '<a href="reports/r77-1.html">b77-1.mcap</a>' in outliers
    assert "never_still" in html[html.index('id="reasons"') : html.index('id="parameters"')]
    ((number, rms),) = re.findall(r">b_a</th><td>(\d+)</td><td>([\d.]+)</td>", html)
    assert int(number) == 3 * 199
    assert 0.9 < float(rms) < 1.1


def test_workers_that_are_killed_while_they_start_are_reported(tmp_path, capfd):
    (deadly := tmp_path / "deadly.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n")
    words = ["batch", str(FIXTURES / "sessions" / "mpu6050.mcap"), "-o", str(tmp_path / "fleet"), "--workers", "1"]
    with changed({"distributed.worker.preload": [str(deadly)]}):
        assert call(words) == 3
    assert re.fullmatch(
        r"mpucal: the workers were ended while they started \(.*\): free memory .*\n", capfd.readouterr().err
    )


@pytest.mark.slow
def test_a_batch_that_is_ended_while_its_workers_start_leaves_no_trace(tmp_path):
    (deadly := tmp_path / "deadly.py").write_text(
        "import os, signal, time\nos.kill(os.getppid(), signal.SIGTERM)\ntime.sleep(99)\n"
    )
    words = [sys.executable, "-m", "mpucal", "batch", str(FIXTURES / "sessions" / "mpu6050.mcap"), "--workers", "1"]
    preload = {"DASK_DISTRIBUTED__WORKER__PRELOAD": json.dumps([str(deadly)])}
    done = subprocess.run(
        [*words, "-o", "fleet"], cwd=tmp_path, env=os.environ | preload, stderr=subprocess.PIPE, text=True, check=False
    )
    assert (done.returncode, done.stderr.strip()) == (4, "mpucal: interrupted.")


def test_a_spreadsheet_only_shows_a_cell():
    values = ("=1+1.mcap", "@x", "a=1", "a\u202eb", -1.5, None)
    assert [*map(escape_cell, values)] == ["'=1+1.mcap", "'@x", "a=1", "a\\u202eb", -1.5, None]


def test_a_batch_of_which_nothing_can_be_read_fails(client, tmp_path, capsys):
    (junk := tmp_path / "junk.csv").write_text("no recording\n")
    words = ["batch", str(junk), "-o", str(tmp_path / "fleet"), "--scheduler", client.scheduler.address]
    assert call(words) == 3
    assert "1 could not be read" in capsys.readouterr().out
