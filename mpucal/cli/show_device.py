"""What a chip or a vehicle holds now, as it is: nothing is reset, set up or written. Knows no file."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np

from ..chip import registers as reg
from ..chip.access import Bus
from ..chip.decode import Decoder
from ..chip.families import PARTS
from ..chip.offsets import PLACES, Block
from ..chip.port import Port
from ..data import STANDARD_GRAVITY_MPS2
from ..errors import UsageError
from ..session.plan import Plan
from ..sources.on_chip import OnBus
from .source import open_bus, open_vehicle

# the accelerometer's six bytes, then the thermometer's two
MEASURED = 0x3B


def of_bus(text: str, address: int | None) -> dict[str, Any]:
    """Facts of the chip on a bus, in JSON's own types.

    Raises
    ------
    UsageError : words that fit no bus. BusError : no chip, or a transfer failed.
    """
    source: OnBus = open_bus(text, Plan(), address, None)
    with closing(source.bus):
        return {"where": f"the chip on {text}", **_chip(source.bus)}


def _chip(bus: Bus) -> dict[str, Any]:
    port = Port(bus, Decoder("the chip"))
    who_am_i = port.read(reg.WHO_AM_I, 1)[0]
    gyro, accel = port.read(reg.GYRO_CONFIG, 2)
    asleep = bool(port.read(reg.PWR_MGMT_1, 1)[0] & reg.PWR_MGMT_1_SLEEP)
    part = PARTS.get(who_am_i)
    scale = (accel & reg.FULL_SCALE) >> reg.FULL_SCALE_SHIFT
    facts: dict[str, Any] = {
        "who_am_i": who_am_i,
        "chip": None if part is None else part.chip,
        "asleep": asleep,
        "accel_range_g": reg.ACCEL_RANGES_G[scale],
        "gyro_range_dps": reg.GYRO_RANGES_DPS[(gyro & reg.FULL_SCALE) >> reg.FULL_SCALE_SHIFT],
        "accel_offsets": {f"0x{place[0]:02x}": list(Block.read(port, place).words) for place in PLACES},
    }
    if asleep or part is None:
        return facts
    data = np.frombuffer(port.read(MEASURED, 8), ">i2").astype(float)
    acc = data[:3] / reg.ACCEL_LSB_PER_G[scale] * STANDARD_GRAVITY_MPS2 / part.accel_sensitivity
    return facts | {
        "acc_mps2": acc.tolist(),
        "temperature_c": float(data[3] / part.family.lsb_per_c + part.family.zero_c),
    }


def of_vehicle(text: str, system: int | None) -> dict[str, Any]:
    """Facts of the vehicle at a URL, in JSON's own types.

    Raises
    ------
    UsageError : words that are no URL. LinkError, NoAnswer : no vehicle, or the link broke.
    """
    from ..mavlink.shaping import read_shaping  # noqa: PLC0415 - pymavlink is slow to load
    from ..mavlink.truth import ARDUPILOT, PX4  # noqa: PLC0415
    from ..sources.on_vehicle import OnLink  # noqa: PLC0415

    source = open_vehicle(text, Plan(), system, None)
    if not isinstance(source, OnLink):
        raise UsageError(f"{text} is no vehicle", "give its --mavlink URL")
    with source.connected(lambda _sentence: None) as link:
        firmware = PX4 if link.vehicle.is_px4 else ARDUPILOT
        return {"where": str(link.vehicle), "firmware": firmware, "parameters": dict(read_shaping(link, firmware))}


def page(facts: Mapping[str, Any]) -> str:
    """The facts as a person reads them."""
    rows = _vehicle_rows(facts) if "firmware" in facts else _chip_rows(facts)
    return "\n".join([f"{facts['where']}, as it is now.", "", *(f"  {key:<18}{value}" for key, value in rows.items())])


def _vehicle_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    held = {name: value for name, value in facts["parameters"].items() if "OFF" in name or "SCAL" in name}
    corrected = [name for name, value in held.items() if value != ("SCAL" in name) and not name.startswith("SENS")]
    said = f"a correction in {len(corrected)} parameters" if corrected else "no correction of its accelerometers"
    return {"holds": said, **{name: f"{value:g}" for name, value in facts["parameters"].items()}}


def _chip_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    name = facts["chip"] or "no chip that mpucal knows"
    rows = {
        "chip": f"{name}, WHO_AM_I 0x{facts['who_am_i']:02x}{', asleep' if facts['asleep'] else ''}",
        "ranges": f"±{facts['accel_range_g']} g, ±{facts['gyro_range_dps']} deg/s",
    }
    for address, words in facts["accel_offsets"].items():
        rows[f"offsets at {address}"] = ", ".join(map(str, words))
    if "acc_mps2" in facts:
        acc = facts["acc_mps2"]
        rows["measures"] = f"({', '.join(f'{a:+.3f}' for a in acc)}) m/s², |a| {np.linalg.norm(acc):.3f}"
        rows["temperature"] = f"{facts['temperature_c']:.1f} °C"
    return rows
