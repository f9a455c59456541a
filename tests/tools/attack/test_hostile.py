"""Slices of the fuzzers, the failed system calls and the campaign; and files of any name."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mpucal.__main__ import run
from tools.attack import fuzz, fuzz_targets, outputs

SESSION = Path(__file__).parents[3] / "fixtures" / "sessions" / "mpu6050.mcap"


@pytest.fixture
def holds(program):
    def call(folder, name, *words):
        done = subprocess.run(program(folder, name, *words), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr

    return call


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    return fuzz_targets.targets(tmp_path_factory.mktemp("targets"))


@pytest.fixture
def fuzzed(targets, monkeypatch):
    """Run fuzz.py on targets, once each with this seed, and give its exit code."""
    monkeypatch.setattr(fuzz_targets, "targets", lambda _: targets)
    handler = signal.getsignal(signal.SIGVTALRM)

    def call(first, *names):
        return fuzz.main(names, first=int(first), seconds=0.0)

    yield call
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    signal.signal(signal.SIGVTALRM, handler)


def test_readers_refuse_mutated_bytes(fuzzed, capsys):
    assert fuzzed(1) == 0, capsys.readouterr().out


def test_readers_withstand_input_guided_by_coverage(holds):
    pytest.importorskip("atheris")
    holds("attack", "fuzz", "--guided", "--seconds", "2", "--first", "1", "bridge", "mcap's messages")


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("clang"), reason="needs clang")
def test_the_firmwares_core_on_hostile_requests(holds):
    holds("attack", "fuzz_core", "--seconds", "5", "--first", "1")


@pytest.mark.parametrize(("seed", "target"), [("207790003882", "npz"), ("207790000083", "dataflash")])
def test_input_that_once_ended_in_a_traceback(fuzzed, capsys, seed, target):
    assert fuzzed(seed, target) == 0, capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux") or not shutil.which("cc"), reason="needs Linux and cc")
def test_files_are_old_or_new_after_any_failed_call_or_allocation(holds):
    holds("attack", "syscalls", "export", "write", "--most", "6", "--allocations", "1", "--seed", "1")


def test_each_option_that_names_an_output_is_tried():
    assert outputs.check_rows() == ""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs fork and pipes")
def test_an_output_that_cannot_be_written_is_left_as_it_is(holds):
    holds("attack", "outputs", "export", "apply .npz", "firmware")


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
@pytest.mark.parametrize(
    "words",
    ["lab campaign --sessions 16 --recordings 40 --first 1", "attack hostile_vehicle --seeds 1 --kinds junk"],
)
def test_sessions_under_attack_end_in_an_allowed_way(words, holds):
    holds(*words.split())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs named pipes and ulimit")
def test_a_pipe_is_not_replayed_and_a_full_disk_is_reported(tmp_path, capsys):
    os.mkfifo(tmp_path / "capture.mcap")
    assert run(["session", "--replay", str(tmp_path)]) == 3
    assert "is a pipe or device" in capsys.readouterr().err
    # bytecode that was cut at that length would fail every import after
    limited = f'export PYTHONDONTWRITEBYTECODE=1; ulimit -f 1; "$@" > {tmp_path}/out.csv'
    words = ["apply", SESSION.with_name("mpu6050.json"), SESSION]
    done = subprocess.run(
        ["sh", "-c", limited, "sh", sys.executable, "-m", "mpucal", *words], capture_output=True, check=False
    )
    assert (done.returncode, b"free space there" in done.stderr) == (3, True)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names are bytes on Linux alone")
def test_a_file_may_be_called_anything(tmp_path, capsys):
    named = tmp_path / os.fsdecode(b"walk\xff\x1b[2J\n.mcap")
    shutil.copy(SESSION, named)
    gone = named.with_suffix(".gone.mcap")
    for words in ("calibrate", named, "-o", tmp_path / "results"), ("calibrate", gone):
        assert run(list(map(str, words))) == (3 if gone in words else 0)
        assert "\x1b" not in (said := "".join(capsys.readouterr()))
    shown = subprocess.run([sys.executable, "-m", "mpucal", "show", named], capture_output=True, check=True)
    assert b"\x1b" not in shown.stdout + shown.stderr
    assert r"walk\udcff\x1b[2J\n" in said
    assert rb"walk\udcff\x1b[2J\n" in (tmp_path / "results" / "report.html").read_bytes()
