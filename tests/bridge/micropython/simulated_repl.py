"""MicroPython's REPL as a board shows it on a serial port, on a pty; what is pasted is run by this Python.

Source of what it says: MicroPython's documentation, "The MicroPython Interactive Interpreter Mode".
"""

import builtins
import contextlib
import os
import select
import threading
import time
import traceback
import tty
from types import SimpleNamespace

BANNER = b'MicroPython v1.27.0 on 2025-12-10; a board with a chip\r\nType "help()" for more information.\r\n'
RAW = b"raw REPL; CTRL-B to exit\r\n>"
WINDOW = 128


class SimulatedRepl:
    """A board.

    Parameters
    ----------
    i2c : machine.I2C(0). folder : its flash. raw_paste : "taken", "refused", or "unknown" as before version 1.14.
    main : whether its main.py runs until Ctrl-C.

    Attributes
    ----------
    name : what the host opens. boots : how often it began anew, or its power came.
    """

    def __init__(self, i2c, folder, raw_paste="taken", main=True, banner=BANNER):
        self._host, self._there = os.openpty()
        tty.setraw(self._there)
        self.name, self.boots = os.ttyname(self._there), 0
        self._i2c, self._folder, self._raw_paste, self._main, self._banner = i2c, folder, raw_paste, main, banner
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self):
        self._stop.set()
        self._thread.join()
        os.close(self._host)
        os.close(self._there)

    def _run(self):
        with contextlib.suppress(InterruptedError):
            raw = False
            while True:
                self.boots += 1
                if not raw and self._main:
                    while self._byte() != b"\x03":
                        continue
                    self._say(b"Traceback (most recent call last):\r\nKeyboardInterrupt: \r\n")
                raw = self._prompt(raw)
                self._say(b"MPY: soft reboot\r\n")

    def _prompt(self, raw):
        """Read lines until Ctrl-D on an empty one; return True in raw mode."""
        self._say(RAW if raw else self._banner + b">>> ")
        line = b""
        while True:
            byte = self._byte()
            if byte == b"\x01":
                raw, line = True, b""
                self._say(b"\r\n" + RAW)
            elif byte == b"\x02":
                raw, line = False, b""
                self._say(b"\r\n" + self._banner + b">>> ")
            elif byte == b"\x03":
                line = b""
                self._say(b"" if raw else b"\r\n>>> ")
            elif byte == b"\x04" and not line:
                return raw
            elif byte == b"\x04" and raw:
                self._say(b"OK")
                self._execute(line)
                line = b""
            elif raw and byte == b"\x05" and not line and self._raw_paste != "unknown":
                if self._byte() + self._byte() == b"A\x01":
                    self._pasted()
            elif not raw and byte in b"\r\n":
                line = b""
                self._say(b"\r\n>>> ")
            else:
                line += byte
                self._say(b"" if raw else byte)

    def _pasted(self):
        if self._raw_paste == "refused":
            self._say(b"R\x00")
            return
        self._say(b"R\x01" + WINDOW.to_bytes(2, "little") + b"\x01")
        text, room = b"", 2 * WINDOW
        while (byte := self._byte()) != b"\x04":
            text += byte
            room -= 1
            assert room >= 0, "more than there is room for"
            if len(text) % WINDOW == 0:
                self._say(b"\x01")
                room += WINDOW
        self._say(b"\x04")
        self._execute(text)

    def _execute(self, text):
        failure = ""
        try:
            exec(compile(text, "<stdin>", "exec"), {"__name__": "__main__", "__builtins__": self._builtins()})
        except InterruptedError:
            raise
        except Exception:
            failure = traceback.format_exc().replace("\n", "\r\n")
        self._say(b"\x04" + failure.encode() + b"\x04>")

    def _builtins(self):
        def i2c(number, **how):
            if number:
                raise ValueError("I2C(1) doesn't exist")
            return self._i2c

        stdin = SimpleNamespace(buffer=SimpleNamespace(read=lambda count: self._byte()))
        stdout = SimpleNamespace(buffer=SimpleNamespace(write=self._say))
        poll = SimpleNamespace(register=lambda *_: None, poll=lambda _: self._has_byte())
        modules = {
            "sys": SimpleNamespace(stdin=stdin, stdout=stdout),
            "select": SimpleNamespace(poll=lambda: poll, POLLIN=1),
            "time": SimpleNamespace(ticks_us=lambda: time.monotonic_ns() // 1000 % 2**30),
            "micropython": SimpleNamespace(kbd_intr=lambda _: None),
            "machine": SimpleNamespace(I2C=i2c, SoftI2C=i2c, Pin=str),
            "os": SimpleNamespace(remove=lambda name: (self._folder / name).unlink()),
        }

        def get(name, *rest):
            return modules[name] if name in modules else __import__(name, *rest)

        def opened(name, mode):
            return (self._folder / name).open(mode)

        return {**vars(builtins), "__import__": get, "open": opened}

    def _has_byte(self):
        if self._stop.is_set():
            raise InterruptedError
        return bool(select.select([self._host], [], [], 0.0005)[0])

    def _byte(self):
        while not self._has_byte():
            continue
        try:
            return os.read(self._host, 1)
        except OSError:
            raise InterruptedError from None

    def _say(self, data):
        while data:
            data = data[os.write(self._host, data) :]
