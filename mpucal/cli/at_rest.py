"""A person who is asked to put the board down. Knows no session."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import click

from ..session.events import Prompt, PromptKind

PUT_DOWN = Prompt(PromptKind.LAY_FLAT, "Lay the board on something firm and let go of it.")


def put_down(listeners: Sequence[Callable[[Prompt], None]]) -> None:
    """Ask for a board at rest, on stderr; `listeners` hear it too."""
    click.echo(f"mpucal: {PUT_DOWN.text}", err=True)
    for listener in listeners:
        listener(PUT_DOWN)
