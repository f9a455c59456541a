"""`mpucal doctor`: examine a chip and its bus, or a vehicle, and print the findings on one page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pkgutil import resolve_name
from typing import Any

import click

from .. import __version__
from ..doctor.finding import Finding, Mark, document, text
from ..errors import SourceError, UsageError
from ..origin import Origin
from ..session.lay_flat import PUT_DOWN, STAND, put_down
from ..sinks.choose import interrupted_writes
from ..sources.kind import SourceKind
from ..sources.opening import open_source
from .common import json_option, say
from .options import Finite
from .source_options import check_source, source_options

EXAMPLE = "Example: `mpucal doctor --bus /dev/i2c-1`, or `mpucal doctor --bus sim:chip=clone98,who_am_i=0x68`"


@click.command("doctor", epilog=EXAMPLE)
@source_options("doctor")
@json_option("Print only the findings, as JSON.")
@click.option("--seconds", type=Finite(2.0), default=10.0, show_default=True, help="Time to observe the samples [s].")
@click.option("--conformance", is_flag=True, help="Compare only a bridge's firmware (--serial) with the protocol.")
def command(as_json: bool, seconds: float, conformance: bool, **options: Any) -> int:
    """Examine what is on a bus, which chip it really is and whether it works as specified; for a bug report.

    Keep the board still. The chip is reset; its offset registers are restored afterwards. Of a vehicle (--mavlink), the
    link, the streams, its state and what a write would change are examined, and nothing is written. Exit code 3: a
    fault was found.
    """
    kind = check_source(click.get_current_context())
    value = options[kind.option.name]
    if conformance and kind.option.name != "serial":
        raise UsageError("--conformance is for the firmware of a bridge", "name its port with --serial")
    findings = tuple(_with_spinner(_conformance(options) if conformance else _examine(kind, options, seconds)))
    click.echo((document if as_json else text)(str(value), __version__, findings))
    return SourceError.exit_code if any(finding.mark is Mark.BAD for finding in findings) else 0


def _with_spinner(findings: Iterator[Finding]) -> Iterator[Finding]:
    """Yield the findings; a terminal shows the last topic and the time meanwhile."""
    from rich.console import Console  # noqa: PLC0415 - most commands need none of it
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    terminal = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=terminal, transient=True, disable=not terminal.is_terminal) as progress:
        line = progress.add_task("Examining", total=None)
        for finding in findings:
            progress.update(line, description=f"Examining ({finding.topic}: done)")
            yield finding


def _conformance(options: Mapping[str, Any]) -> Iterator[Finding]:
    from ..bridge import open_link  # noqa: PLC0415
    from ..bridge.doctor import examine_conformance  # noqa: PLC0415 - loads the link, which only this needs

    try:
        with open_link(options) as link:
            yield from examine_conformance(link)
    except SourceError as error:
        yield Finding.failed("bridge", error)


def _examine(kind: SourceKind, options: Mapping[str, Any], seconds: float) -> Iterator[Finding]:
    for left in interrupted_writes(kind, options):
        yield Finding("earlier write", Mark.NOTE, left)
    if kind.host:
        yield from resolve_name(kind.host)(options[kind.option.name])
    try:
        source = open_source(options)
    except SourceError as error:
        yield Finding.failed("bus", error)
        return
    # A vehicle gets this prompt over its link, once the link is locked.
    of_vehicle = source.origin is Origin.VEHICLE
    put_down(() if of_vehicle else source.listeners, say, STAND if of_vehicle else PUT_DOWN)
    yield from resolve_name(kind.doctor)(source, seconds)
