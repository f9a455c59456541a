"""The installed mpucal against the real firmware on an emulated board, over a pseudo terminal."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

INSTALLED = Path(sys.executable).parent / "mpucal"
SERVE = Path(__file__).parent / "emulator" / "serve.py"
HAND = "sim:seed=3"


@pytest.fixture
def switch_on(emulator, avr_build, tmp_path):
    """Switches the board on for as long as the context lasts; gives it and its port."""

    @contextmanager
    def power():
        words = [
            sys.executable,
            SERVE,
            avr_build[0] / "mpucal_bridge.elf",
            tmp_path / "eeprom.bin",
            "--chip",
            HAND,
            "--bootloader",
            "0.3",
        ]
        board = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            yield board, board.stdout.readline().decode().strip()
        finally:
            # as if it were unplugged
            board.kill()
            board.communicate()

    return power


def mpucal(*words, **how):
    return subprocess.run([INSTALLED, *map(str, words)], capture_output=True, text=True, check=False, **how)


def guided(port, board, folder):
    """A session in which the hand that holds the board hears the prompts; its exit code and what it said."""
    words = [INSTALLED, "session", "--serial", port, "--yes", "--json-events", "-o", folder]
    said = []
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as session:
        for line in session.stderr:
            event = json.loads(line) if line.startswith(b"{") else {}
            if event.get("event") == "prompt":
                board.stdin.write(line)
                board.stdin.flush()
            if event.get("event") in (None, "prompt", "decision", "caution"):
                said.append(line.decode())
    return session.returncode, "".join(said)


@pytest.mark.slow
def test_a_session_ends_in_the_boards_eeprom_and_is_read_back_after_a_restart(switch_on, tmp_path):
    folder = tmp_path / "board"
    with switch_on() as (board, port):
        code, said = guided(port, board, folder)
        assert code == 0, said
        written = mpucal("write", folder / "calibration.json", "bridge", "--serial", port, "--yes")
        assert written.returncode == 0, written.stderr
    calibration = json.loads((folder / "calibration.json").read_text())
    with switch_on() as (_, port):
        shown = mpucal("show", "--serial", port, "--json")
    assert shown.returncode == 0, shown.stderr
    kept = json.loads(shown.stdout)["accelerometer"]
    for name in ("D", "b_a"):
        # as the blob holds it
        assert np.array_equal(np.float32(kept[name]), np.float32(calibration["accelerometer"][name]))
