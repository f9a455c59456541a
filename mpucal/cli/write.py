"""`mpucal write`: put a calibration where the sensor's user will use it, or back what was there before."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import click

from ..data import STANDARD_GRAVITY_MPS2
from ..errors import UsageError, WriteBackError
from ..result.calibration import FORMAT, Calibration
from ..session.results import make_folder, save
from ..sinks.sink import Restorable, Sink
from ..sources.on_chip import OnBus
from .at_rest import put_down
from .options import check_source, source_options
from .source import opened
from .write_back import ask, keep, write_to

EXAMPLE = "Example: `mpucal write board7/calibration.json chip --bus /dev/i2c-1`"


@contextmanager
def on_chip(options: Mapping[str, Any]) -> Iterator[Sink]:
    """The offset registers of the chip that the options name."""
    source = opened(options)
    if not isinstance(source, OnBus) or source.replay is not None:
        raise UsageError("a chip's registers are written over its own bus", "give --bus BUS")
    from ..sinks.chip import ChipSink  # noqa: PLC0415 - each target's own

    with closing(source.bus):
        put_down(source.listeners)
        yield ChipSink(source.bus, f"the chip on {options['bus'] or options['serial']}")


@contextmanager
def in_bridge(options: Mapping[str, Any]) -> Iterator[Sink]:
    """The memory of the bridge that the options name."""
    if options["serial"] is None:
        raise UsageError("a bridge is written over its own port", "give --serial PORT")
    from ..sinks.bridge import BridgeSink  # noqa: PLC0415
    from ..sources.bridge import open_store  # noqa: PLC0415

    with open_store(options["serial"]) as store:
        yield BridgeSink(store)


@contextmanager
def on_autopilot(options: Mapping[str, Any]) -> Iterator[Sink]:
    """The parameters of the vehicle that the options name."""
    if options["mavlink"] is None:
        raise UsageError("an autopilot is written over MAVLink", "give --mavlink URL")
    from ..sinks.autopilot import AutopilotSink  # noqa: PLC0415
    from ..sources.on_vehicle import OnLink  # noqa: PLC0415

    source = opened(options)
    if not isinstance(source, OnLink):
        raise UsageError("a .tlog has no vehicle to write to", "give the vehicle's --mavlink URL")
    with source.connected(lambda text: click.echo(f"mpucal: {text}", err=True)) as link:
        put_down(source.listeners)
        yield AutopilotSink(link, options["store"])


# name: what opens it for the options of the command
TARGETS: dict[str, Callable[[Mapping[str, Any]], Any]] = {
    "chip": on_chip,
    "bridge": in_bridge,
    "autopilot": on_autopilot,
}


@click.command("write", epilog=EXAMPLE)
@click.argument("calibration", metavar="CALIBRATION", type=click.Path(path_type=Path))
@click.argument("target", metavar="|".join(TARGETS), type=click.Choice(list(TARGETS)))
@source_options
@click.option("-o", "folder", metavar="DIR", type=click.Path(path_type=Path), help="Where the old state is kept.")
@click.option("--store", is_flag=True, help="autopilot: keep D in the vehicle's storage too.")
@click.option("--yes", is_flag=True, help="Ask nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print the calibration as it is applied now, and nothing else.")
def command(calibration: Path, target: str, folder: Path | None, yes: bool, as_json: bool, **options: Any) -> None:
    """Write a calibration (.json or .bin), read it back, and see its effect; whatever fails, the old state is restored.

    Where CALIBRATION is the file in which an earlier write kept the old state, that is written back. Exit code 6:
    refused or failed, and the place holds what it held.
    """
    check_source(click.get_current_context())
    written = Calibration.load(calibration) if _is_calibration(calibration) else None
    folder = folder or calibration.parent
    make_folder(folder)
    # a simulated chip lives in the gravity in which it was calibrated
    gravity = STANDARD_GRAVITY_MPS2 if written is None else written.fit.get("gravity") or STANDARD_GRAVITY_MPS2
    with TARGETS[target]({**options, "gravity": gravity, "model": "auto"}) as sink:
        ask(f"Write {calibration} to {sink.where}?", yes)
        if written is None:
            keep(sink, folder)
            click.echo(f"Done: {_put_back(sink, calibration)}.")
            return
        path = folder / f"{calibration.stem}-on-{target}.json"
        applied = write_to(sink, written, folder, lambda now: _save(now, path))
    if as_json:
        click.echo(applied.calibration.json(), nl=False)
        return
    click.echo(f"Done: {applied.what}.")
    click.echo(f"Written to {path} (and .bin): the calibration of the sensor as it is now.")


def _is_calibration(path: Path) -> bool:
    """Whether it is one at all, or a file of another kind that a sink may have kept."""
    if path.suffix != ".json":
        return path.suffix == ".bin" or not path.exists()
    try:
        return bool(json.loads(path.read_bytes()).get("format") == FORMAT)
    except (OSError, ValueError, AttributeError):
        return True


def _save(now: Calibration, path: Path) -> Calibration:
    save(path.parent, {path.with_suffix(".bin").name: now.blob().encode(), path.name: now.json().encode()})
    return now


def _put_back(sink: Sink, kept: Path) -> str:
    if not isinstance(sink, Restorable):
        raise WriteBackError(f"nothing was written: {kept} is no calibration", "give a calibration.json")
    return sink.put_back(kept)
