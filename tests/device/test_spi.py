"""Installed command with the real spidev on a character device: mode, speeds and messages."""

import json

import pytest

import mpucal
from mpucal.chip import registers as reg
from mpucal.sources.spi import DATA

NODE = "/dev/spidev0.0"
pytest.importorskip("spidev", reason="spidev is missing: pip install mpucal[spi]")


def asked_for(mocked, data_hz):
    """Check the requests to the kernel: one mode, and a higher speed for samples alone."""
    mocked.tell(seen=str(mocked.folder / "seen"))
    seen = json.loads((mocked.folder / "seen").read_text())
    assert {(mode, bits) for mode, bits, *_ in seen} == {(3, 8)}
    assert {hz for *_, hz, first, _ in seen if first & 0x7F not in DATA} == {1_000_000}
    assert {hz for *_, hz, first, _ in seen if first == 0x80 | reg.FIFO_R_W} == {data_hz}


@pytest.mark.parametrize(
    ("chip", "name", "data_hz"), [("mpu6500", "MPU-6500", 20_000_000), ("icm20602", "ICM-20602", 8_000_000)]
)
def test_both_sensors_at_1_khz_are_recorded_over_spi(device, chip, name, data_hz):
    mocked = device(f"sim:seed=3,chip={chip}")
    result = mocked.mpucal("record", "--spi", NODE, "--rate", "1000", "--seconds", "1", "-o", "walk.mcap")
    assert result.code == 0, result.err
    recording = mpucal.load(mocked.folder / "walk.mcap")
    assert recording.sensor.chip == name
    assert not recording.gap.any()
    assert len(recording) == pytest.approx(1000, rel=0.04)
    asked_for(mocked, data_hz)


def test_a_chip_in_use_is_refused_to_another_session(device):
    mocked = device("sim:chip=mpu6500")
    with mocked.recording("--spi", NODE):
        refused = mocked.mpucal("session", "--spi", NODE, "--yes", "-o", "two")
    assert refused.code == 3
    assert f"another mpucal uses the chip on {NODE}: end it" in refused.err
