"""Slices of tools/fuzz.py and its like, tools/syscalls.py and tools/campaign.py; seeds are the day's, and printed."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[1] / "tools"


def holds(tool, *words):
    done = subprocess.run([sys.executable, TOOLS / tool, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_readers_refuse_mutated_bytes():
    holds("fuzz.py", "--seconds", "0.15")


def test_by_coverage():
    pytest.importorskip("atheris")
    holds("fuzz.py", "--guided", "--seconds", "2", "bridge", "mcap's messages")


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("clang"), reason="needs clang")
def test_the_firmwares_core_on_hostile_requests():
    holds("fuzz_core.py", "--seconds", "5")


@pytest.mark.parametrize(("seed", "target"), [("207790003882", "npz"), ("207790000083", "dataflash")])
def test_what_once_ended_in_a_trace(seed, target):
    holds("fuzz.py", "--first", seed, "--seconds", "0", target)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux") or not shutil.which("cc"), reason="needs Linux and cc")
def test_files_are_old_or_new_whatever_call_fails():
    holds("syscalls.py", "export", "merge")


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc")
def test_what_is_struck_ends_as_it_may():
    holds("campaign.py", "--sessions", "16", "--recordings", "40")
