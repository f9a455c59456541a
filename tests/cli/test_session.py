import json
import os
import shutil
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from mpucal.chip.access import Transaction
from mpucal.errors import OutputError
from mpucal.files.mcap import read_capture
from mpucal.session.plan import Plan
from mpucal.session.runner import Runner


@pytest.fixture(scope="session")
def rewritten(write_capture):
    """Return a function that writes a capture with another head or other records, and returns its path."""

    def call(capture, path, records=None, **meta):
        return write_capture(path, {**capture.meta, **meta}, capture.records if records is None else records)

    return call


def test_a_session_writes_its_files_and_prints_the_summary(session):
    assert session.result.code == 0, session.result.err
    names = {path.name for path in session.folder.iterdir()}
    assert names == {"capture.mcap", "calibration.json", "calibration.bin", "report.html", "truth.json"}
    out = session.result.out
    assert out.startswith("The calibration is ")
    assert "bias, mg" in out
    assert "±" in out
    assert "firmware" in out
    for heading in ("LAY FLAT", "TURN IT", "PUT IT DOWN"):
        assert heading in session.result.err
        assert heading not in out


def test_a_session_without_a_source_lists_the_connected_ones_as_commands(mpucal, tmp_path, monkeypatch):
    for channel in ("in_accel_x_raw", "in_anglvel_x_raw", "name"):
        for device in ("iio:device0", "iio:device1"):
            (tmp_path / device).mkdir(exist_ok=True)
            (tmp_path / device / channel).write_text("mpu6050\n")
    (tmp_path / "iio:device1" / "in_anglvel_x_raw").unlink()
    ports = [("/dev/ttyACM0", "ArduPilot"), ("/dev/ttyUSB0", "CP2102")]
    monkeypatch.setattr("mpucal.sources.i2c.found_chips", lambda: [("/dev/i2c-1", "MPU-6050 at 0x68")])
    monkeypatch.setattr("mpucal.bridge.port_errors.ports", lambda: ports)
    monkeypatch.setattr("mpucal.iio_device.source.SYSFS", tmp_path)
    result = mpucal("session", "-o", "board 7", code=2)
    found = [line.partition("  ") for line in result.err.replace("\n  ", "\n").splitlines()[1:-1]]
    assert [(command, what.strip()) for command, _, what in found] == [
        ("mpucal session -o 'board 7' --bus /dev/i2c-1", "MPU-6050 at 0x68"),
        ("mpucal session -o 'board 7' --serial /dev/ttyUSB0", "CP2102"),
        ("mpucal session -o 'board 7' --iio iio:device0", "mpu6050"),
        ("mpucal session -o 'board 7' --mavlink /dev/ttyACM0", "ArduPilot"),
        ("mpucal session -o 'board 7' --bus sim", "the simulated chip"),
    ]
    events = mpucal("session", "--json-events").err.splitlines()
    assert len(events) == 1
    assert json.loads(events[0])["exit_code"] == 2


def test_no_folder_is_left_if_nothing_answered_or_the_page_is_refused(mpucal, tmp_path):
    mpucal("session", "--bus", "/dev/i2c-99")
    mpucal("session", "--bus", "sim:who_am_i=0xff")
    mpucal("session", "--bus", "sim:who_am_i=0xff", "-o", "board")
    # an address for documentation (RFC 5737), which no computer has
    refused = mpucal("session", "--bus", "sim", "-o", "board", "--yes", "--page=192.0.2.1:8000")
    assert (refused.code, "no page can be served" in refused.err) == (3, True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("head", "sentence"),
    [
        ({"driver": 0}, "version 0 of the driver"),
        ({"plan": {"config": 3}}, "does not hold the session's settings"),
        *(
            ({"plan": {**asdict(Plan()), **odd}}, "does not hold the session's settings")
            for odd in ({"gravity": "9"}, {"gravity": 1e300}, {"board": "none"})
        ),
    ],
)
def test_a_capture_with_another_head_is_not_replayed(mpucal, session, tmp_path, rewritten, head, sentence):
    capture = read_capture(session.folder / "capture.mcap")
    result = mpucal("session", "--replay", rewritten(capture, tmp_path / "odd.mcap", **head), code=3)
    assert sentence in result.err
    assert "`mpucal calibrate`" in result.err


def test_a_capture_cut_short_while_rotating_is_refused_with_reasons_and_without_a_blob(mpucal, session, tmp_path):
    data = (session.folder / "capture.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(0.3 * len(data))])
    result = mpucal("session", "--replay", "cut.mcap", "-o", "board", code=5)
    assert "cut.mcap" in result.err
    assert "the source ended" in result.err
    assert result.out.startswith("The calibration is refused:\n  - ")
    assert result.out.endswith("and run\n  mpucal session\n")
    assert not (tmp_path / "board" / "calibration.bin").exists()
    assert json.loads((tmp_path / "board" / "calibration.json").read_text())["quality"]["verdict"] == "refused"


def test_a_recording_is_calibrated_and_replayed_later_unless_accesses_are_left_unread(
    mpucal, walk, tmp_path, rewritten
):
    offline, replayed = mpucal("calibrate", walk), mpucal("session", "--replay", walk, "-o", "board")
    assert offline.code == replayed.code != 4
    assert offline.out.splitlines()[0] == replayed.out.splitlines()[0]
    assert mpucal("record", "--bus", "sim", "--seconds", "1", "-o", walk).code == 3
    capture = read_capture(walk)
    last = [record for record in capture.records if isinstance(record, Transaction)][-1]
    longer = mpucal("session", "--replay", rewritten(capture, tmp_path / "long.mcap", [*capture.records, last]), code=3)
    assert "before the last 1 accesses of its capture" in longer.err


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others do not tell where a folder went")
def test_a_folder_renamed_and_a_capture_truncated_during_a_session(mpucal, walk, tmp_path, monkeypatch):
    """The results follow the capture, and a capture that another program shortens is reported."""
    calibrate = Runner.calibrate

    def meddled(runner, *words):
        meddle()
        return calibrate(runner, *words)

    monkeypatch.setattr(Runner, "calibrate", meddled)
    words = ("session", "--replay", walk, "--yes", "-o", "board")
    meddle = lambda: Path("board").rename("seven")  # noqa: E731
    renamed = mpucal(*words, code=5)
    assert str(tmp_path / "seven" / "report.html") in renamed.out
    assert {path.name for path in tmp_path.iterdir()} == {"seven"}
    assert {"capture.mcap", "calibration.json", "report.html"} <= {path.name for path in Path("seven").iterdir()}

    meddle = lambda: os.truncate("board/capture.mcap", 1000)  # noqa: E731
    cut = mpucal(*words, code=3)
    assert "board/capture.mcap was shortened or overwritten by another program" in cut.err
    assert "is kept in board/capture.mcap, and the results in board" in cut.err


def test_a_nearly_full_disk_is_refused_before_the_board_is_lifted(mpucal, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr("mpucal.session.results.shutil.disk_usage", lambda path: usage._replace(free=1_500_000))
    result = mpucal("session", "--bus", "sim", "-o", tmp_path / "board", code=OutputError.exit_code)
    assert "only 1.5 MB are free" in result.err
    assert "Lay the board flat" not in result.err
    assert not (tmp_path / "board").exists()
