"""The person at the terminal, beside the results on stdout: what is said to them, and a question that they confirm."""

from __future__ import annotations

import sys

import click

from ..errors import WriteBackError


def say(text: str) -> None:
    """A sentence, on stderr."""
    click.echo(f"mpucal: {text}", err=True)


def ask_in_doubt(question: str, yes: bool) -> None:
    """Go on only where a person agrees to what speaks against it; without one, keep what is there.

    Raises
    ------
    WriteBackError : nobody agreed.
    """
    against = question.partition(". ")[0]
    if yes or not sys.stdin.isatty():
        raise WriteBackError(f"nothing was changed: {against}", "repeat the session, or `mpucal write` it as it is")
    if not click.confirm(question[:1].upper() + question[1:], err=True):
        raise WriteBackError(f"nothing was changed: {against}, and you declined", "repeat the session")


def ask(question: str, yes: bool) -> None:
    """Go on where the person agrees, or cannot be asked.

    Raises
    ------
    WriteBackError : the person said no.
    """
    if not yes and sys.stdin.isatty() and not click.confirm(question, err=True):
        raise WriteBackError("nothing was written: you declined", "repeat it when you want it written")
