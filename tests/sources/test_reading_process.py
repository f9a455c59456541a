"""Reading in a process of its own; the chip is simulated."""

import os
import signal
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from mpucal.chip.config import Config
from mpucal.chip.driver import Driver
from mpucal.chip.registers import FIFO_COUNT_H, USER_CTRL
from mpucal.errors import BusError, EndOfCapture, NoAnswer
from mpucal.session.events import Prompt, PromptKind
from mpucal.simulated.chip import open_simulated
from mpucal.sources.chip import CAN_FORK
from mpucal.sources.reading_process import ProcessSource
from mpucal.sources.replay import ReplayBus, Tap
from tools.lab.feeds import open_recorded

pytestmark = pytest.mark.skipif(not CAN_FORK, reason="only Linux forks here")


def rest(n=400):
    """A simulated chip that serves n samples and ends."""
    rng = np.random.default_rng(5)
    counts = rng.normal(0.0, 8.0, (2, n, 3)).round().astype(int)
    counts[0, :, 2] += 8192
    return open_recorded(*counts, rate_hz=200.0, accel_range_g=4, gyro_range_dps=500)


def tapped(bus):
    accesses = []
    return Tap(bus, accesses.append), accesses


def in_a_process(bus, hands=(), parts=None):
    tap, accesses = tapped(bus)
    return ProcessSource(Driver(tap, Config()), tap, parts, hands), accesses


def measure(source, polls=10**6):
    """Return the samples of each poll until the end."""
    samples = []
    try:
        source.start()
        for _ in range(polls):
            samples.append(source.poll())
    except EndOfCapture:
        pass
    return samples


def test_stops_the_sensor_after_what_the_session_used():
    opened, accesses = in_a_process(open_simulated("sim", seed=1))
    with closing(opened) as source:
        samples = measure(source, polls=5)
        source.stop()
    assert accesses[-1].register == USER_CTRL
    assert sum(access.register == FIFO_COUNT_H for access in accesses) < 30
    # A replay stops at the same place, and reads all of it.
    bus = ReplayBus(accesses)
    again = Driver(bus, Config())
    np.testing.assert_array_equal(measure(again, polls=5)[-1].t, samples[-1].t)
    again.stop()
    assert bus.unread() == 0


@pytest.mark.parametrize("error", [NoAnswer("nothing acknowledges", "check the wires"), ZeroDivisionError("a trial")])
def test_raises_the_error_of_a_bus_and_a_fault_of_the_program_with_its_place(error):
    def fails(_register, _count):
        raise error

    bus = SimpleNamespace(read=fails, sleep_until=lambda t_ns: None)
    with closing(in_a_process(bus)[0]) as source, pytest.raises(type(error), match=str(error)) as raised:
        source.start()
    notes = getattr(raised.value, "__notes__", [])
    assert any("in fails" in note for note in notes) is isinstance(error, ZeroDivisionError)


def test_says_that_the_process_was_killed():
    simulated = open_simulated("sim", seed=1)

    def killing(register, count):
        if register == FIFO_COUNT_H:
            os.kill(os.getpid(), signal.SIGKILL)
        return simulated.read(register, count)

    bus = SimpleNamespace(read=killing, write=simulated.write, sleep_until=simulated.sleep_until)
    with (
        closing(in_a_process(bus)[0]) as source,
        pytest.raises(BusError, match="reads the sensor was killed by signal 9: start again"),
    ):
        measure(source)


def test_the_hand_gets_the_prompts_in_the_process():
    seen, told = os.pipe()
    prompt = Prompt(PromptKind.LAY_FLAT, "Lay it flat")
    opened, _ = in_a_process(open_simulated("sim", seed=1), hands=[lambda prompt: os.write(told, prompt.text.encode())])
    with closing(opened) as source:
        measure(source, polls=1)
        source.hear(prompt)
        assert os.read(seen, 100) == b"Lay it flat"
        source.stop()
    os.close(seen)
    os.close(told)


@pytest.fixture
def written():
    """A simulated chip, and a stream of the bytes that a reading process writes to its USER_CTRL."""
    here, told = os.pipe()
    simulated, session = open_simulated("sim", seed=1), os.getpid()

    def write(register, data):
        if register == USER_CTRL and os.getpid() != session:
            os.write(told, data)
        return simulated.write(register, data)

    with os.fdopen(here, "rb") as stream:
        bus = SimpleNamespace(read=simulated.read, write=write, sleep_until=simulated.sleep_until, close=lambda: None)
        yield bus, stream, lambda: os.close(told)


def test_ends_with_the_session_and_stops_the_sensor(written):
    bus, stream, close = written
    pid = os.fork()
    if not pid:
        # A session that is killed.
        measure(in_a_process(bus)[0], polls=1)
        os.kill(os.getpid(), signal.SIGKILL)
    close()
    os.waitpid(pid, 0)
    assert stream.read()[-1:] == b"\0"


def test_stops_the_sensor_if_the_session_fails_before_it_does(written):
    bus, stream, close = written
    with pytest.raises(ZeroDivisionError), closing(in_a_process(bus)[0]) as source:
        measure(source, polls=1)
        raise ZeroDivisionError
    close()
    assert stream.read()[-1:] == b"\0"


def test_a_resumed_session_is_replayed_here_before_the_process_goes_on():
    before = tapped(rest())
    measure(Driver(before[0], Config()))

    def resumed():
        return ReplayBus(before[1], live=rest())

    chain = resumed()
    bus, alone = tapped(chain)
    driver = Driver(bus, Config())
    measure(driver)
    assert chain.open_next_part()
    measure(driver)
    chain = resumed()
    opened, accesses = in_a_process(chain, parts=chain)
    with closing(opened) as source:
        measure(source)
        assert chain.open_next_part()
        assert measure(source)
        assert accesses == alone
        np.testing.assert_array_equal(source.recording().t, driver.recording().t)
