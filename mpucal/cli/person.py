"""Messages and questions to the person at the terminal; results go to stdout."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click

from ..errors import WriteBackError


def say(text: str) -> None:
    """Print a sentence on stderr."""
    click.echo(f"mpucal: {text.strip()}", err=True)


def say_done(clauses: Sequence[str], err: bool = False) -> None:
    """Print what was done, a line for each clause, on stdout or on stderr."""
    told = ";\n  ".join(clauses)
    click.echo(f"Done: {told}.", err=err)


def duration(seconds: float) -> str:
    """Return a time in s, min or h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def ask_in_doubt(question: str, yes: bool) -> None:
    """Ask about an objection; raise WriteBackError unless a person agrees, also with `yes` or without a person."""
    objection = question.partition(". ")[0]
    if yes or not sys.stdin.isatty():
        raise WriteBackError(f"nothing was changed: {objection}", "repeat the session, or `mpucal write` it as it is")
    if not click.confirm(question[:1].upper() + question[1:], err=True):
        raise WriteBackError(f"nothing was changed: {objection}, and you declined", "repeat the session")


def ask(question: str, yes: bool) -> None:
    """Ask for confirmation; raise WriteBackError if a person declines."""
    if not yes and sys.stdin.isatty() and not click.confirm(question, err=True):
        raise WriteBackError("nothing was written: you declined", "give the command again to write it")


def confirm(question: str, with_yes: bool, yes: bool) -> bool:
    """Return the answer to a question: `with_yes` if `yes` is given, and False without a person."""
    if yes:
        return with_yes
    return sys.stdin.isatty() and click.confirm(question, err=True)
