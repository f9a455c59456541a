"""Installed command on /dev/i2c-1: a session from start to blob, its write-back, and one sentence for each fault."""

import errno
import json

import numpy as np
import pytest

from mpucal import Calibration, load
from mpucal.data import STANDARD_GRAVITY_MPS2

NODE, UPTIME_S = "/dev/i2c-1", 900


def calibration(b_a):
    return Calibration(np.eye(3), np.array(b_a), quality={"verdict": "good", "reasons": []})


def test_a_chip_in_use_is_refused_to_other_commands(sound):
    calibration([0.1] * 3).save(sound.folder / "c.json")
    before = sorted(sound.folder.rglob("*"))
    commands = {"session": ("--yes", "-o", "two"), "doctor": (), "write": ("c.json", "chip", "--yes")}
    with sound.recording("--bus", NODE):
        for command, words in commands.items():
            refused = sound.mpucal(command, "--bus", NODE, *words)
            assert refused.code == 3, command
            assert "another mpucal uses the chip at 0x68 on /dev/i2c-1" in refused.out + refused.err, command
    assert sorted(set(sound.folder.rglob("*")) - set(before)) == [sound.folder / "held.mcap"]


def test_a_clone_that_calls_itself_a_6050_gets_its_bias_where_a_6500_keeps_it_and_gives_it_back(device):
    mocked = device("sim:chip=clone98,who_am_i=0x68,D=1/0/0/0/1/0/0/0/1,b_a=0.3/-0.2/0.4")
    mocked.tell(prompt={"kind": "lay_flat", "down": None}, pass_s=5.0)
    b_a = np.array([0.3, -0.2, 0.4])
    calibration(b_a).save(mocked.folder / "c.json")

    def held(first):
        words = [mocked.run("i2cget", "-y", "1", "0x68", hex(first + 3 * axis), "w").out for axis in range(3)]
        return [int.from_bytes(int(word, 16).to_bytes(2, "little"), "big", signed=True) for word in words]

    mine, other = held(0x77), mocked.run("i2cget", "-y", "1", "0x68", "0x06", "w").out
    written = mocked.mpucal("write", "c.json", "chip", "--bus", NODE, "-o", "old")
    assert written.code == 0, written.err
    assert "the offset registers at 0x77" in written.out
    assert mocked.run("i2cget", "-y", "1", "0x68", "0x06", "w").out == other
    # 2048 LSB/g, and bit 0 is kept
    assert np.subtract(mine, held(0x77)) == pytest.approx(b_a / STANDARD_GRAVITY_MPS2 * 2048, abs=2)
    assert [word & 1 for word in mine] == [word & 1 for word in held(0x77)]
    back = mocked.installed("write", "old/chip-offsets.json", "chip", "--bus", "1")
    assert back.code == 0, back.err
    assert f"the chip on {NODE} " in back.out
    assert held(0x77) == mine


@pytest.mark.parametrize(
    ("adapter", "words"),
    [
        ({"address": 0x50}, "nothing answers at 0x68 or 0x69 on /dev/i2c-1: check VCC"),
        ({"fails": errno.ETIMEDOUT}, "a wire holds SDA or SCL low"),
        ({"fails": errno.EIO}, "a transfer broke off"),
        ({"bound": [0x68, 0x69]}, "echo 1-0068 | sudo tee /sys/bus/i2c/devices/1-0068/driver/unbind"),
        ({"fails": errno.ENODEV}, "nothing answers at 0x68"),  # i2c-stub's number for an empty address
    ],
    ids=["nobody", "stuck", "broken", "bound", "empty"],
)
def test_a_chip_that_cannot_be_reached_is_one_sentence(sound, adapter, words):
    with sound.but_for(adapter):
        result = sound.mpucal("session", "-o", "x", "--bus", NODE)
    assert result.code == 3
    (sentence,) = result.sentences
    assert words in sentence
    assert result.err.strip() == sentence


def test_a_clock_at_the_same_address_is_one_sentence_and_goes_on(device):
    mocked = device("DS3231")
    words = "the chip at this address is a real-time clock (a DS1307 or DS3231), not an MPU"
    session = mocked.mpucal("session", "--bus", NODE)
    doctor = mocked.mpucal("doctor", "--bus", NODE, "--json")
    assert (session.code, doctor.code) == (3, 3)
    remedy = "tie the MPU's AD0 to VCC and give --address 0x69"
    assert session.sentences == [f"mpucal: {words}: {remedy}."]
    chip = next(finding for finding in json.loads(doctor.out)["findings"] if finding["topic"] == "chip")
    assert (chip["what"], chip["remedy"]) == (words, remedy)
    assert mocked.run("i2cget", "-y", "1", "0x68", "0x05").out.strip() == "0x12"


def test_an_smbus_only_adapter_measures_too(device):
    mocked = device()
    mocked.tell(adapter={"functions": 0x0EFF0008})
    result = mocked.mpucal("record", "--bus", NODE, "-o", "x.mcap", "--seconds", "1", "--rate", "50")
    assert result.code == 0, result.err
    assert "samples" in result.out


@pytest.mark.slow
def test_passing_faults_leave_only_marked_gaps(device):
    faults = {"nack": 2, "brownout": 4, "overflow": 6, "timeout": 10, "slip": 12, "frozen": 14}
    mocked = device("sim:fault=" + "/".join(f"{name}@{at_s}" for name, at_s in faults.items()))
    result = mocked.mpucal("record", "--bus", NODE, "-o", "x.mcap", "--seconds", "18", "--rate", "50")
    assert result.code == 0, result.err
    recording = load(mocked.folder / "x.mcap")
    steps = np.diff(recording.t) * recording.rate_hz
    assert len(recording) > 600
    assert steps[~recording.gap[1:]].max() < 1.5
    # the device's time began before the program
    gaps_s = recording.t[recording.gap] - UPTIME_S
    after_s = gaps_s - [faults[name] for name in ("brownout", "overflow", "slip", "frozen")]
    assert ((after_s > 0) & (after_s < 2.2)).all()
