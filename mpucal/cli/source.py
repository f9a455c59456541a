"""What the words of the source options open. Knows no session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..chip.config import Config
from ..errors import UsageError
from ..files.mcap import read_capture
from ..files.parts import captures_in
from ..session.plan import Plan
from ..simulated.chip import open_simulated
from ..sources.i2c import I2cBus
from ..sources.on_chip import OnBus
from ..sources.opened import Opened
from ..sources.parts import PartsBus, parts_of
from ..sources.replay import ReplayBus
from .options import SIMULATED, TLOG, refuse_fixed


def open_bus(text: str, plan: Plan, address: int | None, seed: int | None) -> OnBus:
    """A Linux I2C bus, or the simulated chip.

    Raises
    ------
    UsageError : words that fit no bus. BusError : no such bus, or no permission.
    """
    if text == SIMULATED or text.startswith(SIMULATED + ":"):
        if address is not None:
            raise UsageError("--address is where a real chip answers, and --bus names a simulated one", "leave it out")
        bus = open_simulated(text, plan.gravity, seed)
        return OnBus(
            bus, plan, (bus.hear,), bus.truth_document(), words={"bus": text, "seed": seed}, real_time=bus.real_time
        )
    if seed is not None:
        raise UsageError("--seed chooses a simulated sensor, and --bus names a real one", "leave it out")
    return OnBus(I2cBus(text, address), plan, words={"bus": text, "address": address})


def open_serial(text: str, plan: Plan, address: int | None, seed: int | None) -> OnBus:
    """A chip behind a serial bridge.

    Raises
    ------
    UsageError : no port was named. BusError : no such port, no permission, or no bridge on it.
    """
    # pyserial is of no use to a chip on another bus
    from ..sources.bridge import open_bridge  # noqa: PLC0415

    if seed is not None:
        raise UsageError("--seed chooses a simulated sensor, and --serial names a real one", "leave it out")
    if plan.config.accel_alone:
        raise UsageError(
            f"a bridge does not move {plan.config.rate_hz:g} samples a second",
            "take --rate 1000 or less, or connect the chip to an I2C bus of this computer",
        )
    return OnBus(open_bridge(text, address), plan, words={"serial": text, "address": address})


def open_replay(file: Path) -> OnBus:
    """A capture, or all those in the folder of a session that was resumed, to be run again.

    Raises
    ------
    CaptureError : no capture, or one of another driver.
    """
    captures = [read_capture(path) for path in (captures_in(file) or [file])]
    name = captures[0].name
    bus = PartsBus([ReplayBus(part, name) for part in parts_of(capture.records for capture in captures)])
    recovered = [capture.recovered for capture in captures if capture.recovered]
    return OnBus(
        bus,
        Plan.of_capture(captures[0].meta, name),
        replay=bus,
        recovered=recovered[-1] if recovered else None,
        real_time=False,
    )


def open_again(words: Mapping[str, Any], plan: Plan) -> OnBus:
    """The source of a session that is resumed, by the words in its capture's head."""
    if words.get("serial") is not None:
        return open_serial(words["serial"], plan, words.get("address"), None)
    return open_bus(words["bus"], plan, words.get("address"), words.get("seed"))


def open_vehicle(text: str, plan: Plan, system: int | None, key: Path | None) -> Opened:
    """A vehicle over MAVLink, or the simulated one.

    Raises
    ------
    UsageError : words that are no URL, or no key. LinkError : it cannot be opened.
    """
    # pymavlink is slow to load, and of no use to a chip on a bus
    from ..mavlink.lines import open_transport  # noqa: PLC0415
    from ..mavlink.signing import read_key  # noqa: PLC0415
    from ..mavlink.url import parse_url  # noqa: PLC0415
    from ..sources.on_vehicle import OnLink  # noqa: PLC0415

    signing_key = None if key is None else read_key(key)
    if text == SIMULATED or text.startswith(SIMULATED + ":"):
        return _simulated_vehicle(text, plan, system, signing_key)
    url = parse_url(text)
    return OnLink(open_transport(url), plan, system, signing_key)


def _simulated_vehicle(text: str, plan: Plan, system: int | None, key: bytes | None) -> Opened:
    from ..simulated.vehicle import Vehicle, VehicleOptions  # noqa: PLC0415
    from ..simulated.vehicle.transport import SimulatedTransport  # noqa: PLC0415
    from ..sources.on_vehicle import OnLink  # noqa: PLC0415

    vehicle = Vehicle(VehicleOptions.parse(text), plan.gravity, key)
    transport = SimulatedTransport(vehicle)
    return OnLink(transport, plan, system, key, truth=vehicle.truth_document(), real_time=transport.real_time)


def open_vehicle_replay(file: Path, plan: Plan, system: int | None) -> Opened:
    """A .tlog, to be run again; `plan` and `system` are for one that another ground station recorded.

    Raises
    ------
    CaptureError : no .tlog, or one of another version. RecordingError : no vehicle or no IMU in it.
    UsageError : options that a .tlog of mpucal fixes.
    """
    from ..sources.on_vehicle import OnLink, open_tlog  # noqa: PLC0415

    source = open_tlog(file, plan, system)
    if isinstance(source, OnLink):
        refuse_fixed(click.get_current_context())
    return source


def opened(options: Mapping[str, Any], until_end: bool = False) -> Opened:
    """What --bus, --serial, --mavlink or --replay of a command's `options` names, with the options beside it."""
    config = Config(int(options["accel_range"]), int(options["gyro_range"]), options["rate"], options["dlpf"])
    aim = {name: options[name] for name in ("target", "tilt_only", "attended") if name in options}
    model = "tilt" if options["model"] == "auto" and options.get("tilt_only") else options["model"]
    plan = Plan(config, options["gravity"], model, until_end, **aim)
    if options["serial"] is not None:
        return open_serial(options["serial"], plan, options["address"], options["seed"])
    if options["mavlink"] is not None:
        return open_vehicle(options["mavlink"], plan, options["system"], options["signing_key"])
    if options["replay"] is not None:
        if options["replay"].suffix.lower() == TLOG:
            return open_vehicle_replay(options["replay"], replace(plan, until_end=True), options["system"])
        return open_replay(options["replay"])
    return open_bus(options["bus"], plan, options["address"], options["seed"])
