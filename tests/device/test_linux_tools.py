"""i2c-tools see the mocked adapter and the chip on it, as they would real ones."""

import shutil

import pytest

pytestmark = pytest.mark.skipif(shutil.which("i2cget") is None, reason="Debian's i2c-tools are missing")


@pytest.mark.parametrize(("chip", "identity"), [("clone98", "0x98")])
def test_i2cget_reads_who_am_i(device, chip, identity):
    assert device(f"sim:chip={chip}").run("i2cget", "-y", "1", "0x68", "0x75").out.strip() == identity


@pytest.fixture(scope="module")
def mocked(device_of_module):
    return device_of_module()


def test_i2cget_and_i2cset_keep_a_register(mocked):
    assert mocked.run("i2cset", "-y", "1", "0x68", "0x1b", "0x08").code == 0
    assert mocked.run("i2cget", "-y", "1", "0x68", "0x1b").out.strip() == "0x08"


def test_i2cdetect_finds_the_chip_and_nothing_else(mocked):
    table = mocked.run("i2cdetect", "-y", "-r", "1").out.splitlines()[1:]
    found = {cell for row in table for cell in row.partition(":")[2].split()} - {"--"}
    assert found == {"68"}


def test_i2cdetect_sees_a_driver_of_the_kernel(mocked):
    with mocked.but_for({"bound": [0x68]}):
        assert "UU" in mocked.run("i2cdetect", "-y", "-r", "1").out
