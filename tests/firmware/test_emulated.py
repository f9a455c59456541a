"""Real firmware on an emulated ATmega328P, in its own time: registers, streams, blobs, power."""

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.store import BlobStore
from mpucal.calibration import calibrate
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.cli.running import open_runner
from mpucal.errors import BusError
from mpucal.result.blob import Blob
from mpucal.result.calibration import Calibration
from mpucal.session.plan import Plan
from mpucal.simulated.chip import Chip, SimulatedBus, open_simulated
from mpucal.simulated.chip.models import MODELS, FactoryTrim
from mpucal.sources.chip import OpenedChip
from mpucal.terminal.console import console

ROOT = Path(__file__).parents[2]
OLD = (ROOT / "fixtures" / "vectors" / "blob_measured.bin").read_bytes()
NEW = replace(Blob.decode(OLD), b_a=(1.0, 2.0, 3.0)).encode()

FLASH_LIMIT, RAM_LIMIT = 8192, 1024
FIXED_LIMIT = 1000
RATE_HZ = 1000


STILL = (1000, -2000, 8000, -700, 300, -200, 30000)


class Feed:
    """Accelerometer, temperature and gyroscope stand still; `numbered`: accelerometer x and y hold the number."""

    def __init__(self, numbered):
        self._next, self._numbered = 0, numbered

    def samples(self, edges_s, _setting):
        numbers = np.arange(self._next, self._next + len(edges_s) - 1)
        self._next += len(numbers)
        words = np.tile(np.int16(STILL), (len(numbers), 1))
        if self._numbered:
            words[:, 0], words[:, 1] = np.divmod(numbers, 1000)
        return words


def _numbering(clock, numbered=True):
    return SimulatedBus(Chip(MODELS["mpu6050"], Feed(numbered), 0.0, FactoryTrim()), clock)


@pytest.fixture(scope="module")
def open_store(greeted):
    return lambda port: BlobStore(greeted(port))


def test_flash_and_ram_leave_room(avr_build):
    flash, ram = map(int, re.search(r"(\d+) bytes of flash .* (\d+) bytes of RAM", avr_build[1]).groups())
    assert (flash < FLASH_LIMIT, ram < RAM_LIMIT) == (True, True)


@pytest.mark.slow
def test_the_readme_gives_the_cycles_that_are_counted(make, need):
    need("simavr")
    said = make("cycles")[1]
    counted = re.findall(r"\d+ cycles", said)
    readme = (ROOT / "mpucal" / "firmware" / "README.md").read_text()
    # the compiler's version decides the last per cents
    for cycles, stated in zip(counted, re.findall(r"\d+\s+cycles", readme), strict=True):
        assert int(cycles.split()[0]) == pytest.approx(int(stated.split()[0]), rel=0.15)
    assert int(counted[1].split()[0]) < FIXED_LIMIT
    # rounding takes half a count
    assert 0.4 < float(re.search(r"at most (\S+) counts off", said)[1]) < 0.6


def test_the_sketch_is_the_same_bridge(switch_on, sketches, open_store, started):
    board, port = switch_on(elf=sketches / "mpucal_bridge_sketch.elf")
    driver = started(board, port, 200)
    assert driver.known.who_am_i == 0x68
    recording = driver.until(2)
    assert (recording.gap.sum(), len(recording) > 150) == (0, True)
    driver.stop()
    store = open_store(port)
    store.write(OLD)
    assert store.read() == (1, OLD)


def test_the_sketch_writes_as_many_bytes_as_the_protocol_allows(switch_on, sketches):
    """Wire's buffer holds 32 bytes, one of which is the register."""
    _, port = switch_on(elf=sketches / "mpucal_bridge_sketch.elf")
    bus = BridgeBus(port)
    for count in (31, 32):
        # zeros wake the chip and start nothing
        bus.write(reg.PWR_MGMT_1 + 2 - count, bytes(count - 1) + bytes([count]))
        assert bus.read(reg.PWR_MGMT_1, 2).data == bytes([0, count])


def test_the_corrected_sketch_prints_what_is_stored(switch_on, sketches, open_store):
    sloped = (ROOT / "fixtures" / "vectors" / "blob_sloped.bin").read_bytes()
    _, port = switch_on()
    open_store(port).write(sloped)
    board, _ = switch_on(lambda clock: _numbering(clock, numbered=False), sketches / "mpucal_corrected_sketch.elf")
    board.run(0.5)
    *_, line, _ = board.receive().decode().splitlines()
    words = np.array(STILL, float)
    y, T, w = words[:3] * (4 * 9.80665 / 32768), words[3] / 340 + 36.53, words[4:] * np.radians(1 / 65.5)
    wanted = np.concatenate(Calibration.from_blob(Blob.decode(sloped)).apply(y, w, T))
    np.testing.assert_allclose([float(number) for number in line.split()], wanted, atol=2e-4)


@pytest.mark.slow
def test_half_a_kilohertz_fits_115200_baud(switch_on, make, started):
    board, port = switch_on(_numbering, make("all")[0] / "mpucal_bridge.elf")
    recording = started(board, port, 500).until(3)
    assert (recording.gap.sum(), board.overruns, len(recording) > 1000) == (0, 0, True)


@pytest.mark.parametrize("seconds", [2, pytest.param(60, marks=pytest.mark.slow)])
def test_1_khz_at_500_kbaud_loses_nothing(switch_on, seconds, started):
    board, port = switch_on(_numbering)
    recording = started(board, port, RATE_HZ).until(seconds + 1)
    words = np.rint(recording.acc * 8192 / 9.80665).astype(int)
    numbers = words[:, 0] * 1000 + words[:, 1]
    assert len(numbers) >= seconds * RATE_HZ
    assert np.array_equal(numbers, np.arange(len(numbers)) + numbers[0])
    assert (recording.gap.sum(), board.overruns) == (0, 0)
    assert recording.rate_hz == pytest.approx(RATE_HZ, rel=1e-4)
    assert np.diff(recording.t) == pytest.approx(1 / RATE_HZ, rel=1e-3)


@pytest.mark.slow
def test_a_whole_session_ends_in_the_eeprom_and_outlives_the_power(switch_on, open_store, tmp_path):
    hand = []

    def held(clock):
        hand.append(open_simulated("sim:seed=3", clock=clock))
        return hand[0]

    board, port = switch_on(held)
    opened = OpenedChip(BridgeBus(port), Plan(Config(rate_hz=50), target="quick"), (hand[0].hear,), real_time=False)
    with open_runner(opened, tmp_path / "capture.mcap", console(quiet=True)) as runner:
        found = runner.calibrate(runner.measure(), calibrate)
    assert found.verdict == "good", found.quality["reasons"]
    open_store(port).write(found.blob().encode())
    board.cut_power()
    store = open_store(switch_on()[1])
    assert store.read() == (1, found.blob().encode())


class Gone(Exception):  # noqa: N818 - stands for a plug that was pulled
    """Failure of the power."""


@pytest.mark.parametrize(
    "torn", [0xA5, *(pytest.param(each, marks=pytest.mark.slow) for each in (0x00, 0xFF))], ids=hex
)
def test_power_loss_at_any_cycle_of_a_blob_write_leaves_the_old_blob_or_the_new(torn, switch_on, open_store, tmp_path):
    eeprom = tmp_path / "eeprom.bin"
    board, port = switch_on()
    open_store(port).write(OLD)
    holds_old, began = eeprom.read_bytes(), board.cycle
    open_store(port).write(NEW)
    cycles = board.cycle - began
    board.cut_power()

    def held_after(cycles):
        """Cut the power `cycles` after the host began to write NEW; return the blob at the next start."""
        eeprom.write_bytes(holds_old)
        board, port = switch_on()
        store, run_cycles = open_store(port), board.run_cycles
        end = board.cycle + int(cycles)

        def run_until_power_fails(count):
            run_cycles(min(count, end - board.cycle))
            if board.cycle >= end:
                raise Gone

        board.run_cycles = run_until_power_fails
        with suppress(Gone, BusError):
            store.write(NEW)
        board.cut_power(torn)
        return open_store(switch_on()[1]).read().data

    rng = np.random.default_rng(torn)
    found = [held_after(cut) for cut in rng.integers(0, cycles, 4)]
    assert set(found) <= {OLD, NEW}
    # the write becomes valid with its last bytes
    assert held_after(2 * cycles) == NEW
    assert held_after(cycles // 2) == OLD
