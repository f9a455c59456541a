"""`mpucal doctor`: examine a chip and its bus, and tell it on one page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing
from typing import Any

import click

from .. import __version__
from ..data import STANDARD_GRAVITY_MPS2
from ..doctor.bridge import examine_bridge
from ..doctor.examine import examine
from ..doctor.finding import Finding, Mark, failed
from ..doctor.host import examine_host
from ..doctor.page import document, text
from ..doctor.speed import examine_speed
from ..errors import SourceError, UsageError
from ..session.at_rest import put_down
from ..sources.on_chip import OnBus
from .options import check_gyroscope, check_source, source_options
from .person import say
from .source import opened

EXAMPLE = "Example: `mpucal doctor --bus /dev/i2c-1`, or `mpucal doctor --bus sim:chip=clone98,who_am_i=0x68`"


@click.command("doctor", epilog=EXAMPLE)
@source_options
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON, and nothing else.")
@click.option("--seconds", type=click.FloatRange(2.0), default=10.0, show_default=True, help="Watch the stream.")
def command(as_json: bool, seconds: float, **options: Any) -> int:
    """Say what is on a bus, which chip it really is and whether it does what it should; for a bug report.

    The board is to lie still. The chip is reset; its offset registers hold afterwards what they held before.
    Exit code 3: something is at fault.
    """
    check_source(click.get_current_context())
    if options["mavlink"] is not None or options["replay"] is not None:
        raise UsageError("a doctor examines a chip on its own bus", "give --bus BUS or --serial PORT")
    findings = tuple(_findings(options, seconds))
    source = str(options["bus"] or options["serial"])
    tell = document if as_json else text
    click.echo(tell(source, __version__, findings))
    return SourceError.exit_code if any(finding.mark is Mark.BAD for finding in findings) else 0


def _findings(options: Mapping[str, Any], seconds: float) -> Iterator[Finding]:
    bus = options["bus"]
    if bus is not None and not bus.startswith("sim"):
        yield from examine_host(bus)
    try:
        source = opened({**options, "gravity": STANDARD_GRAVITY_MPS2, "model": "auto"})
    except SourceError as error:
        yield failed("bus", error)
        return
    if not isinstance(source, OnBus):
        raise UsageError("a doctor examines a chip on its own bus", "give --bus BUS or --serial PORT")
    check_gyroscope(source.plan.config)
    with closing(source.bus):
        put_down(source.listeners, say)
        way = examine_speed if options["serial"] is None else examine_bridge
        yield from examine(source.bus, source.plan.config, seconds, way)
