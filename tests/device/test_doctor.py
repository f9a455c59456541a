"""`mpucal doctor` on /dev/i2c-1: what a person would paste into a bug report."""

import errno
import json

import pytest

NODE = "/dev/i2c-1"


def examined(mocked, *words):
    mocked.tell(prompt={"kind": "lay_flat", "down": None})
    result = mocked.mpucal("doctor", "--bus", NODE, "--seconds", "2", *words)
    return result, {finding["topic"]: finding for finding in json.loads(result.out)["findings"]} if words else {}


def test_a_chip_under_another_name_is_recognised_and_a_correction_in_it_noticed(device):
    mocked = device("sim:chip=clone98,who_am_i=0x68")
    mocked.tell(registers={str(0x77): "1234"})
    result, findings = examined(mocked, "--json")
    assert result.code == 0
    assert "behaves as an" in findings["chip"]["what"]
    assert "400 kHz measured" in findings["bus speed"]["what"]
    assert findings["offset registers"]["data"]["place"] == 0x77
    assert findings["genuine?"]["mark"] == "note"
    assert findings["factory trim"]["mark"] == "note"
    assert findings["factory trim"]["data"]["held"][0] == 0x1234
    # the examination leaves it unchanged
    assert mocked.run("i2cget", "-y", "1", "0x68", "0x77").out.strip() == "0x12"


@pytest.mark.parametrize(
    ("adapter", "topic", "words"),
    [
        ({"address": 0x50}, "on the bus", "0x50, an EEPROM"),
        ({"bound": [0x68]}, "on the bus", "held by a kernel driver"),
        ({"fails": errno.ETIMEDOUT}, "bus", "does not become free"),
    ],
    ids=["nobody", "bound", "stuck"],
)
def test_obstacles_are_reported_with_their_remedy(sound, adapter, topic, words):
    with sound.but_for(adapter):
        result, findings = examined(sound, "--json")
    assert result.code == 3
    assert words in findings[topic]["what"]
    assert findings["bus"]["mark"] == "bad"
    assert findings["bus"]["remedy"]


def test_the_tools_of_linux_find_the_chip_and_a_kernels_driver(sound):
    """Examine the mocked adapter by i2c-tools: they judge the mock, too."""
    table = sound.run("i2cdetect", "-y", "-r", "1").out.splitlines()[1:]
    assert {cell for row in table for cell in row.partition(":")[2].split()} - {"--"} == {"68"}
    assert sound.run("i2cget", "-y", "1", "0x68", "0x75").out.strip() == "0x68"
    with sound.but_for({"bound": [0x68]}):
        assert "UU" in sound.run("i2cdetect", "-y", "-r", "1").out


def test_no_permission_comes_with_what_to_do(device):
    mocked = device()
    mocked.forbid()
    result, findings = examined(mocked, "--json")
    assert result.code == 3
    assert "usermod -aG i2c" in findings["device file"]["remedy"]


def test_a_slow_bus_comes_with_the_setting_that_helps(sound):
    sound.configure(100_000)
    with sound.but_for({"address": 0x50}):
        _, findings = examined(sound, "--json")
    assert "100 kHz" in findings["adapter"]["what"]
    assert "i2c_arm_baudrate=400000" in findings["adapter"]["remedy"]
