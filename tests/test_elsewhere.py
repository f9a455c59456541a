"""Machines without Linux: modules that are missing there, and a console with keys of its own."""

import io
import subprocess
import sys
from types import SimpleNamespace

from mpucal.session.events import Key
from mpucal.terminal.keys import Keys

# modules that Windows lacks, and of which macOS has other versions
LINUX = ("fcntl", "grp", "pwd", "pty", "resource", "termios", "tty")
# optional: for vehicles and for pictures
EXTRAS = ("pymavlink", "matplotlib", "pandas", "polars")
IMPORT_ALL = f"""
import importlib, pkgutil, sys
sys.modules |= dict.fromkeys({LINUX + EXTRAS!r})
import mpucal
for module in pkgutil.walk_packages(mpucal.__path__, "mpucal."):
    importlib.import_module(module.name)
print("all")
"""


def test_every_module_can_be_imported_without_linux_and_extras():
    done = subprocess.run([sys.executable, "-c", IMPORT_ALL], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "all", done.stderr


def test_missing_pymavlink_is_reported_with_its_install_command():
    program = "import sys; sys.modules['pymavlink'] = None\nfrom mpucal.__main__ import run; sys.exit(run())"
    words = [sys.executable, "-c", program, "session", "--mavlink", "sim", "--no-write"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pymavlink, which reads MAVLink, is not installed: pip install 'mpucal[mavlink]'." in done.stderr


def test_keys_come_from_a_windows_console(monkeypatch):
    typed = list("x\rR\x00q")
    console = SimpleNamespace(kbhit=lambda: bool(typed), getwch=lambda: typed.pop(0))
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    keys = Keys(io.StringIO(), single=True)
    with keys.listening():
        assert keys.pressed() == [Key.ENOUGH, Key.REDO, Key.ABORT]
        assert keys.pressed() == []
