"""Choice of the console by the streams and the environment."""

import io
import sys

import pytest

from mpucal.terminal.console import JsonLines, Lines, console
from mpucal.terminal.screen import Screen


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("err", "term", "as_json", "kind"),
    [
        (Terminal, "xterm-256color", False, Screen),
        (Terminal, "dumb", False, Lines),
        (Terminal, "", False, Lines),
        (Terminal, "xterm", True, JsonLines),
        (io.StringIO, "xterm", False, Lines),
        (io.StringIO, "xterm", True, JsonLines),
    ],
    ids=["terminal", "dumb", "no TERM", "terminal, json", "pipe", "pipe, json"],
)
def test_the_console_follows_from_the_streams(monkeypatch, err, term, as_json, kind):
    monkeypatch.setattr(sys, "stderr", err())
    monkeypatch.setenv("TERM", term)
    assert type(console(quiet=False, as_json=as_json)) is kind


def test_a_cell_of_a_notebook_has_a_terminal_without_a_screen(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(sys, "stdin", Terminal())
    monkeypatch.setenv("TERM", "xterm-color")
    monkeypatch.setenv("JPY_PARENT_PID", "1")
    assert type(console(quiet=False)) is Lines
