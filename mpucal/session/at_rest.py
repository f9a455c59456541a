"""Asking a person to put the board down, outside a session."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .events import Prompt, PromptKind

PUT_DOWN = Prompt(PromptKind.LAY_FLAT, "Put the board on a firm surface and let go of it.")


def put_down(listeners: Sequence[Callable[[Prompt], None]], say: Callable[[str], None]) -> None:
    """Ask for a board at rest; `listeners` hear it, too."""
    say(PUT_DOWN.text)
    for listener in listeners:
        listener(PUT_DOWN)
