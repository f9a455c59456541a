"""Chip on USB adapters: the two real libraries on simulated USB layers."""

import sys
import time
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from mpucal.__main__ import run
from mpucal.chip import registers as reg
from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.doctor.finding import Finding, Mark
from mpucal.errors import BusError, NoAnswer
from mpucal.simulated.chip import open_simulated
from mpucal.simulated.chip.bus import FastClock
from mpucal.sources.usb_i2c import Ftdi, Mcp2221, adapters

pytest.importorskip("pyftdi")
pytest.importorskip("EasyMCP2221")
SPELLED = {"ftdi": "ftdi://ftdi:232h/1", "mcp2221": "mcp2221"}


class HostClock(FastClock):
    """Clock of the host, since the chip was made."""

    def __init__(self):
        super().__init__()
        self._begun_ns = time.monotonic_ns()

    def now(self):
        return time.monotonic_ns() - self._begun_ns

    def spend(self, ns):
        """Do nothing: the adapter has taken the time already."""


@pytest.fixture
def chip():
    return open_simulated("sim:seed=1,hand=still", clock=HostClock())


@pytest.fixture
def plugged(chip, monkeypatch):
    """Plugs in both adapters, with one chip behind them."""
    from pyftdi.usbtools import UsbTools

    ftdi = _beside("ftdi_device")
    backend = ModuleType("an_ft232h")
    backend.get_backend = lambda: ftdi.Backend(chip)
    monkeypatch.setitem(sys.modules, "an_ft232h", backend)
    monkeypatch.setattr(UsbTools, "BACKENDS", ("an_ft232h",))
    UsbTools.flush_cache()
    UsbTools.UsbApi = None
    hid = _beside("mcp2221_device").Hid(chip)
    monkeypatch.setattr("EasyMCP2221.MCP2221.hid", hid)
    monkeypatch.setitem(sys.modules, "hid", hid)
    yield chip
    UsbTools.release_all_devices()
    UsbTools.flush_cache()
    UsbTools.UsbApi = None


def _beside(name):
    spec = spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(params=[("ftdi", Ftdi), ("mcp2221", Mcp2221)], ids=["ftdi", "mcp2221"])
def adapter(request, plugged):
    return partial(request.param[1], SPELLED[request.param[0]])


def test_an_address_without_a_chip_is_reported(adapter):
    with pytest.raises(NoAnswer, match=r"0x69"):
        adapter(0x69)
    bus = adapter()
    assert bus.read(reg.WHO_AM_I, 1).data == b"\x68"
    bus.close()


def test_the_driver_samples_over_it(adapter):
    bus = adapter()
    driver = Driver(bus, Config(rate_hz=100))
    driver.start()
    end = time.monotonic() + 60.0
    while len(driver.recording()) < 50:
        driver.poll()
        assert time.monotonic() < end, "the chip delivers no samples"
    driver.stop()
    bus.close()


def test_plugged_adapters_are_listed(plugged):
    assert [spelled for spelled, _ in adapters()] == ["ftdi://ftdi:232h:FT232H/1", "mcp2221"]


@pytest.mark.parametrize("enumerated", [True, False])
def test_several_adapters_are_named_by_their_serials(enumerated, chip, monkeypatch):
    """Out of the factory none enumerates with it, and it is found by the one in its flash."""
    hid = _beside("mcp2221_device").Hid(chip, ("0001", "0002"), enumerated)
    monkeypatch.setattr("EasyMCP2221.MCP2221.hid", hid)
    monkeypatch.setattr("EasyMCP2221.Device._catalog", {})
    monkeypatch.setitem(sys.modules, "hid", hid)
    names = ["mcp2221:0001", "mcp2221:0002"] if enumerated else ["mcp2221:SERIAL"] * 2
    # before and after a search for adapters
    for _ in range(2):
        for name, path in (("mcp2221:0002", b"2"), ("mcp2221:0001", b"1")):
            bus = Mcp2221(name)
            assert (hid.opened, bus.address) == (path, 0x68)
            bus.close()
        assert [spelled for spelled, _ in adapters() if "mcp" in spelled] == names


@pytest.mark.parametrize("name", SPELLED)
def test_the_doctor_lists_adapters_and_examines_the_chip(name, plugged, capsys, monkeypatch):
    def examine(bus, *_):
        yield Finding("chip", Mark.OK, f"0x{bus.read(reg.WHO_AM_I, 1).data.hex()}", "", {})

    monkeypatch.setattr("mpucal.doctor.examine.examine", examine)
    assert run(["doctor", "--bus", SPELLED[name]]) == 0
    said = capsys.readouterr().out
    assert all(text in said for text in ("--bus ftdi://ftdi:232h:FT232H/1", "--bus mcp2221", "0x68"))


@pytest.mark.parametrize("name", ["ftdi://ftdi:2232h/1", "mcp2221:none"])
def test_a_missing_adapter_is_reported(name, plugged):
    kind = Ftdi if name.startswith("ftdi") else Mcp2221
    with pytest.raises(BusError, match=r"the USB adapter .* cannot be opened"):
        kind(name)


@pytest.mark.parametrize("name", SPELLED)
def test_a_missing_library_is_named(name, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyftdi.i2c", None)
    monkeypatch.setitem(sys.modules, "EasyMCP2221", None)
    assert run(["show", "--bus", SPELLED[name]]) == BusError.exit_code
    assert "pip install mpucal[usb]" in capsys.readouterr().err
