"""Examples in each command's help, run with simulated devices."""

import re
import shlex
import shutil
from dataclasses import replace

import click
import pytest

from mpucal.cli import COMMANDS, commands
from mpucal.files import load
from mpucal.result.calibration import Calibration

# Devices of the examples, and those of the tests. Examples with a serial bridge are tested with the bridges.
DEVICES = {"/dev/i2c-1": "sim:seed=3", "sim": "sim:seed=3"}
# This example is run by tests/test_readme.py.
ELSEWHERE = "session --bus sim"
SHORTER = {"session": ("--rate", "50", "--target", "quick"), "record": ("--rate", "25")}
NEEDS_A_PORT = "--serial PORT"


def examples():
    context = click.Context(commands)
    for name in COMMANDS:
        said = commands.get_command(context, name).epilog
        for number, example in enumerate(re.findall(r"`mpucal ([^`]+)`", said)):
            if NEEDS_A_PORT not in example and example != ELSEWHERE:
                yield pytest.param(example, id=f"{name}-{number}")


@pytest.fixture(scope="module")
def made(session, save, tmp_path_factory):
    """Return a folder with the results and recordings that the examples name."""
    into = tmp_path_factory.mktemp("made")
    made = Calibration.load(session.folder / "calibration.json")
    for number, name in enumerate(("board7", "board7-today", "cold", "warm", "hot")):
        (into / name).mkdir()
        sensor = replace(made.sensor, temperature_c=10.0 + 10.0 * number)
        replace(
            made, sensor=sensor, b_a=made.b_a + 0.01 * number, fit={**made.fit, "recording_digest": f"{number:064x}"}
        ).save(into / name / "calibration.json")
    made.save(into / "calibration.json")
    shutil.copy(session.folder / "capture.mcap", into)
    (into / "line3").mkdir()
    shutil.copy(session.folder / "capture.mcap", into / "line3")
    save(load(session.folder), into / "walk.npz")
    return into


@pytest.fixture
def belongings(made, tmp_path):
    """Copy these files, so that an example may change them."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)


@pytest.mark.parametrize("example", list(examples()))
def test_an_example_runs(mpucal, belongings, tmp_path, example):
    words = [DEVICES.get(word, word) for word in shlex.split(example)]
    if words[0] in ("session", "record"):
        # These commands create the folder and the file.
        shutil.rmtree(tmp_path / "board7")
        (tmp_path / "capture.mcap").unlink()
    result = mpucal(*words, *SHORTER.get(words[0], ()))
    assert result.code == 0, result.err
    assert result.out


def test_every_command_has_one_that_runs_here():
    assert {example.id.rpartition("-")[0] for example in examples()} == set(COMMANDS)
