"""Process of its own that reads a sensor, so that nothing else that a session does keeps the FIFO waiting.

The process is forked when the sensor starts. Its driver reads the bus, and here the same driver continues from the same
state with the accesses that arrive from there. A driver's accesses depend on the replies alone, so that both make the
same ones, and what happens above the bus is as without the process.
"""

from __future__ import annotations

import os
import signal
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from multiprocessing.connection import Connection, Pipe
from queue import SimpleQueue
from threading import Thread
from typing import Any, Protocol

from ..chip.access import Transaction
from ..data import Sensor
from ..errors import BusError
from ..session.beside import describe_end
from ..session.events import Prompt
from ..session.ports import Source
from .recorded_parts import RecordedParts
from .replay import ReplayBus, Tap, as_asked, successful

# Message by which the session asks the process to stop, and the process marks the end of its polls.
STOP = None
# Time for the process to stop the sensor.
STOP_S = 2.0


class BusDriver(Source, Protocol):
    """Source that reads by accesses to a bus, which depend on the replies alone."""

    def read(self) -> None:
        """Wait a little, and read the samples that came meanwhile, as `poll`, which returns them."""


class ProcessSource:
    """Source that a process of its own reads from `start` on.

    Parameters
    ----------
    driver : measures through `tap`, whose bus is usable after a fork. parts : of a resumed session: the process reads
        the last one. hands : receivers of the prompts, in the process.
    """

    def __init__(
        self, driver: BusDriver, tap: Tap, parts: RecordedParts[Any] | None, hands: Sequence[Callable[[Prompt], None]]
    ) -> None:
        self._driver, self._tap, self._parts, self._hands = driver, tap, parts, hands
        self.poll, self.recording = driver.poll, driver.recording
        self.forget, self.now_ns = driver.forget, driver.now_ns
        self._followed: FollowedBus | None = None

    def start(self) -> Sensor:
        """Start the process, and the sensor in it; see Source."""
        if self._parts is None or not self._parts.replaying:
            self._followed = self._tap.bus = FollowedBus(*start_reading(self._read))
        return self._driver.start()

    def stop(self) -> None:
        """Stop the sensor after the present poll of the process; accesses that the session has not read are dropped."""
        if self._followed is not None:
            self._followed.stop_polling()
        self._driver.stop()

    def hear(self, prompt: Prompt) -> None:
        """Pass a prompt to the hands."""
        if self._followed is not None:
            self._followed.tell(prompt)

    def close(self) -> None:
        """End the process, which stops the sensor if it still runs."""
        if self._followed is not None:
            self._followed.close()

    def _read(self, session: Connection) -> None:
        """Read the bus until the session says so or has ended."""
        outbox = Outbox(session)
        self._tap.record = outbox.put
        with closing(outbox), closing(self._tap):
            try:
                self._driver.start()
                outbox.send()
                while not self._should_stop(session):
                    self._driver.read()
                    outbox.send()
                    self._driver.forget()
                outbox.put(STOP)
                self._driver.stop()
            except Exception as error:  # the session raises it at this place
                error.add_note(f"in the reading process:\n{traceback.format_exc()}")
                outbox.put(error)

    def _should_stop(self, session: Connection) -> bool:
        """Pass the prompts of the session to the hands; return True if it asks to stop, or has ended."""
        with suppress(OSError, EOFError):
            while session.poll():
                wish = session.recv()
                if wish is STOP:
                    return True
                for hand in self._hands:
                    hand(wish)
            return False
        return True


def start_reading(read: Callable[[Connection], None]) -> tuple[Connection, int]:
    """Fork a process that does nothing but `read`; return the connection to it, and its process id.

    Parameters
    ----------
    read : called in the process with its end of the connection; the process ends with it.
    """
    here, there = Pipe()
    with warnings.catch_warnings():
        # Python 3.12 warns of a fork beside threads; the process uses none of their locks.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        there.close()
        return here, pid
    try:
        here.close()
        # Ctrl-C reaches the session alone. Where the kernel schedules each session's processes as one group, this
        # group has a process that sleeps most of the time.
        os.setsid()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        # Real-time priority, if the user may set it; the process sleeps between two reads.
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
        read(there)
    finally:
        os._exit(0)


class Outbox:
    """Queue in the reading process, which never waits for the session; it grows while the session reads nothing.

    Items that were `put` into it go out together, as one parcel, at the next `send`.
    """

    def __init__(self, session: Connection) -> None:
        self._items: list[Any] = []
        self.put = self._items.append
        self._queue: SimpleQueue[list[Any] | None] = SimpleQueue()
        self._thread = Thread(target=self._send, args=(session,))
        self._thread.start()

    @property
    def unsent(self) -> int:
        """Number of parcels that the session has no room for yet."""
        return self._queue.qsize()

    def send(self) -> None:
        """Send the items that were put into it."""
        self._queue.put(self._items[:])
        self._items.clear()

    def close(self) -> None:
        """Send the remaining items."""
        self.send()
        self._queue.put(None)
        self._thread.join()

    def _send(self, session: Connection) -> None:
        with suppress(OSError):
            while (items := self._queue.get()) is not None:
                session.send(items)


class FollowedBus(ReplayBus):
    """Bus of the session: it answers with the accesses that the reading process has made.

    Parameters
    ----------
    process : connection to it. pid : its process id.
    """

    def __init__(self, process: Connection, pid: int) -> None:
        super().__init__((), "the reading process")
        self._process, self.pid = process, pid
        self._arrived: deque[Any] = deque()
        self._ended: BusError | None = None

    def tell(self, wish: Prompt | None) -> None:
        """Send a prompt, or the wish to stop."""
        with suppress(OSError):
            self._process.send(wish)

    def stop_polling(self) -> None:
        """Drop the accesses until those that stop the sensor."""
        self.tell(STOP)
        with suppress(Exception):
            while self._received() is not STOP:
                pass

    def close(self) -> None:
        """End the process, after it has stopped the sensor."""
        if self._ended is None:
            self.tell(STOP)
            with suppress(OSError, EOFError):
                while self._process.poll(STOP_S):
                    self._process.recv_bytes()
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        self._process.close()

    def _next_recorded(self, asked: Transaction) -> Transaction:
        return successful(as_asked(asked, self._received(), "that of the reading process"))

    def _received(self) -> Any:
        """Wait for the next access; raise an exception that the process sent instead, or BusError if it has ended."""
        if self._ended is not None:
            raise self._ended
        try:
            while not self._arrived:
                self._arrived.extend(self._process.recv())
        except (OSError, EOFError):
            code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            self._ended = BusError(f"the process that reads the sensor {describe_end(code)}", "start again")
            raise self._ended from None
        item = self._arrived.popleft()
        if isinstance(item, Exception):
            raise item
        return item
