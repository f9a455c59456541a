"""Faults of a chip that does not answer or holds the bus, and of a processor that hangs, on firmware and sketch."""

import numpy as np
import pytest

from mpucal.bridge import messages as wire
from mpucal.bridge.bus import BridgeBus
from mpucal.bridge.link import LinkLost
from mpucal.bridge.messages import Status
from mpucal.chip import registers as reg
from mpucal.errors import BusError, NoAnswer

I2C_MS, REPLY_MS = 25, 100
# of timer 0, which both clocks count with; in data space
TCCR0B = 0x45


@pytest.fixture
def fault(emulator):
    return emulator[0].Fault


@pytest.fixture(params=["firmware", "sketch"])
def bridge(request, switch_on):
    """Makes a board with the firmware or the sketch: (board, port)."""
    if request.param == "firmware":
        return switch_on()
    return switch_on(elf=request.getfixturevalue("sketches") / "mpucal_bridge_sketch.elf")


def test_a_chip_that_is_disconnected_is_reported(bridge, fault):
    board, port = bridge
    bus = BridgeBus(port)
    board.fault(fault.NO_ADDRESS)
    with pytest.raises(NoAnswer):
        bus.read(reg.WHO_AM_I, 1)
    board.fault(fault.SOUND)
    assert bus.read(reg.WHO_AM_I, 1).data == b"\x68"
    board.fault(fault.NO_ADDRESS)
    with pytest.raises(NoAnswer):
        BridgeBus(port)


def test_data_without_acknowledge_do_not_mean_a_missing_chip(bridge, fault, greeted):
    board, port = bridge
    link = greeted(port)
    board.fault(fault.NO_DATA)
    answers = link.ask(wire.Write(reg.SMPLRT_DIV, b"\x07"), wire.Read(reg.WHO_AM_I, 1))
    assert [answer.reply.status for (answer,) in answers] == [Status.BUS_FAILED] * 2
    board.fault(fault.SOUND)
    assert link.ask(wire.Read(reg.WHO_AM_I, 1))[0][0].reply.data == b"\x68"


def test_a_bus_that_a_chip_holds_is_freed_in_time(bridge, fault, greeted):
    board, port = bridge
    link = greeted(port)
    board.fault(fault.HOLDS_BUS)
    began_s = board.now_s
    answers = link.ask(wire.Read(reg.WHO_AM_I, 1))
    assert answers[0][0].reply.status == Status.BUS_FAILED
    assert I2C_MS <= (board.now_s - began_s) * 1e3 < REPLY_MS
    # nine pulses on SCL have freed it
    assert link.ask(wire.Read(reg.WHO_AM_I, 1))[0][0].reply.data == b"\x68"


@pytest.mark.parametrize("bridge", ["firmware", pytest.param("sketch", marks=pytest.mark.slow)], indirect=True)
def test_a_session_continues_after_the_bus_was_held(bridge, fault, started):
    board, port = bridge
    driver = started(board, port, 200)
    driver.until(1)
    board.fault(fault.HOLDS_BUS)
    recording = driver.until(2.5)
    assert np.diff(recording.t)[~recording.gap[1:]].max() < 1.5 / 200
    assert recording.t[-1] - recording.t[0] > 1.8
    assert len(recording) > 300


def test_a_program_that_hangs_is_restarted(bridge, fault, greeted):
    """The clock has stopped, and with it the time-out of a transfer."""
    board, port = bridge
    link = greeted(port)
    board.poke(TCCR0B, 0)
    board.fault(fault.HOLDS_BUS)
    with pytest.raises(BusError):
        link.ask(wire.Read(reg.WHO_AM_I, 1))
    board.fault(fault.SOUND)
    board.run(2.5)
    with pytest.raises(LinkLost, match="was reset"):
        link.ask(wire.Read(reg.WHO_AM_I, 1))
    link.greet()
    assert link.ask(wire.Read(reg.WHO_AM_I, 1))[0][0].reply.data == b"\x68"
