"""Console of a session on stderr: a screen, lines of text, or lines of JSON; and the wording of uncertainties."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Protocol, TextIO

from ..report.units import UNKNOWN
from ..result.document import plain
from ..session.boards import BOARD
from ..session.events import Caution, Decision, Direction, Key, Knowledge, Output, Progress, Prompt, Verification
from ..session.ports import Operator
from ..session.rotate import REPORT_EVERY_S
from .keys import Keys
from .view import HEADLINES

# Jupyter sets this variable for its kernels.
KERNEL = "JPY_PARENT_PID"


class Console(Operator, Protocol):
    """Interface that shows a session, and returns keys."""

    def say(self, text: str) -> None:
        """Show a message."""

    def listening(self) -> AbstractContextManager[None]:
        """Show the session, and accept keys, Ctrl-C among them, within the context."""

    def hung_up(self, stop: bool) -> None:
        """Handle a terminal that was closed; with `stop`, as if Ctrl-C was pressed."""


def console(
    quiet: bool, as_json: bool = False, beep: bool | None = None, title: str = "", board: str = BOARD
) -> Console:
    """Return the console that stderr and stdin allow.

    Parameters
    ----------
    quiet : accept no keys. as_json : one JSON object a line instead of text.
    beep : ring at each new prompt; None: only on a screen. title : name of the sensor. board : kind of picture.
    """
    term = os.environ.get("TERM", "dumb")
    # A process that a notebook starts has a terminal which shows no screen and sends no keys.
    interactive = KERNEL not in os.environ
    on_screen = interactive and sys.stderr.isatty() and term not in ("", "dumb") and not as_json
    keys = Keys(sys.stdin if interactive and not quiet and sys.stdin.isatty() else None, single=on_screen)
    if as_json:
        return JsonLines(sys.stderr, keys)
    if not on_screen:
        return Lines(sys.stderr, keys, bell=bool(beep))
    from .letters import glyphs_of  # noqa: PLC0415 - rich takes a while to load
    from .screen import Screen  # noqa: PLC0415

    return Screen(sys.stderr, keys, glyphs_of(sys.stderr, term), bell=beep is not False, title=title, board=board)


KEYS = "(Enter: skip ahead; r and Enter: restart the turning; q and Enter, or Ctrl-C: stop.)"
BELL = "\a"


class Lines:
    """Console that prints lines of text.

    Parameters
    ----------
    out : stream to print on. keys : source of key presses. bell : ring at each new prompt.
    """

    def __init__(self, out: TextIO, keys: Keys, bell: bool = False) -> None:
        self._out, self._keys, self._bell = out, keys, bell
        self._explained = not keys.has_keyboard
        self._open = True
        self._prompt: Prompt | None = None
        self._last = ""
        self._due_s = -math.inf

    def hear(self, output: Output) -> None:
        """Print an output; progress once a second."""
        match output:
            case Prompt():
                self._say_prompt(output)
            case Progress(t_s, _, _, text) if text != self._last and t_s >= self._due_s - 1e-6:
                self._last, self._due_s = text, t_s + REPORT_EVERY_S
                self.say(f"  {text}")
            case Knowledge():
                self.say(f"  {known(output)}")
            case Caution(_, _, what, do):
                self.say(f"  ! {sentence(what)} {sentence(do)}")
            case Verification():
                self.say(f"  {output.text}")
            case Decision(why):
                self.say(f"  {why}")

    def say(self, text: str) -> None:
        """Print a line; once the stream is closed, print nothing, so that the session goes on."""
        if self._open:
            try:
                print(text, file=self._out, flush=True)
            except OSError:
                self._open = False

    def pressed(self) -> Sequence[Key]:
        """Return the keys that were pressed since the last call."""
        return self._keys.pressed()

    def listening(self) -> AbstractContextManager[None]:
        """Take the first Ctrl-C as a key press within the context; see Keys."""
        return self._keys.listening()

    def hung_up(self, stop: bool) -> None:
        """Print on the log from now on; with `stop`, act as at Ctrl-C."""
        self._open = True
        if stop:
            self._keys.abort()

    def _say_prompt(self, prompt: Prompt) -> None:
        """Print a heading and the prompt; the prompt alone if its kind is that of the last one."""
        bell = BELL if self._bell and prompt != self._prompt else ""
        goes_on = self._prompt is not None and self._prompt.kind is prompt.kind
        self._prompt = prompt
        if goes_on:
            self.say(f"{bell}  {prompt.text}")
            return
        keys = "" if self._explained else f"\n  {KEYS}"
        self._explained = True
        self.say(f"{bell}\n{HEADLINES[prompt.kind]}\n  {prompt.text}{keys}\n")


class JsonLines(Lines):
    """Console that prints each output as a line of JSON, for other front ends: its name in lower case, its fields."""

    def hear(self, output: Output) -> None:
        """Print an output."""
        self._event(type(output).__name__.lower(), plain(output))

    def say(self, text: str) -> None:
        """Print a message as the event `note`."""
        self._event("note", {"text": text.strip()})

    def _event(self, name: str, fields: Mapping[str, Any]) -> None:
        super().say(json.dumps({"event": name, **fields}, allow_nan=False))


class Group(NamedTuple):
    """Parameters of one kind, for x, y and z: progress 0..1, standard uncertainties (1 sigma), and their target."""

    name: str
    unit: str
    progress: Direction
    std: Direction
    target: float

    @property
    def worst(self) -> int:
        """Index of the axis that is farthest from its target."""
        return min(range(3), key=lambda i: self.progress[i])

    def text(self, axis: int) -> str:
        """Return the uncertainty of an axis with its unit."""
        return f"±{rounded(self.std[axis])} {self.unit}" if self.std[axis] < UNKNOWN else "not observable"


def groups(k: Knowledge) -> tuple[Group, Group, Group]:
    """Return the groups scale factor error, misalignment and bias."""
    return (
        Group("scale factor error", "%", k.gain, k.gain_pct, k.target.gain_pct),
        Group("misalignment", "deg", k.misalignment, k.misalignment_deg, k.target.misalignment_deg),
        Group("bias", "mg", k.bias, k.bias_mg, k.target.bias_mg),
    )


def known(k: Knowledge) -> str:
    """Return the largest uncertainty of each group, and its target, as text."""
    text = ", ".join(f"{g.name} {g.text(g.worst)} (target {g.target:g})" for g in groups(k))
    return f"1 sigma: {text}" + (f"; {k.doubt}" if k.doubt else "")


def rounded(value: float) -> str:
    """Return a number with two digits, and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def count(p: Progress) -> str:
    """Return the progress as text, with the time that is left if that is known."""
    if p.left_s is None:
        return p.text
    what, comma, reason = p.text.partition(" (")
    return f"{what}, about {max(10.0 * round(p.left_s / 10.0), 10.0):.0f} s more{comma}{reason}"


def sentence(text: str) -> str:
    """Return a text with a capital letter and a full stop."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
