"""Examination of a vehicle over MAVLink, before anybody lifts it; nothing is written to it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..clocks import US
from ..clocks.device_clocks import Jump
from ..clocks.host_clock import HostClock
from ..data import Recording
from ..doctor.finding import Finding, Mark
from ..doctor.measure import examine_clock, examine_gravity
from ..errors import RecordingError, SourceError
from ..mavlink.dialect import Message, dialect
from ..mavlink.firmwares import FILTERS, PX4, accel_lag_s
from ..mavlink.link import Link
from ..mavlink.log import Log
from ..mavlink.parameters.client import read_parameters, read_stream_parameters
from ..mavlink.parameters.mounting import BOARD_ROTATION, ORIENTATION, mounting, trim_names, trim_of
from ..mavlink.parameters.slots import Slot, Values, find_slot
from ..mavlink.requests import ask, check_prearm, encode_command, is_armed
from ..mavlink.stream import SLOW_SHARE, Streams
from ..mavlink.vehicle_source import LOSS_SHARE
from ..rests.flat import flat_statistics
from ..result.error_model import MG_PER_MPS2
from ..session.lay_flat import STAND, put_down
from .source import OpenedVehicle

# FIRMWARE_VERSION_TYPE of AUTOPILOT_VERSION
KINDS = ((255, ""), (192, "-rc"), (128, "-beta"), (64, "-alpha"), (0, "-dev"))
# Single messages come late; every IMU stream has ten or more a second.
SILENT_S = 1.0
STOP_IT = "end it, or have it leave the rates and the parameters alone while mpucal measures and writes"
MOVED = "the vehicle moved: put it down on its feet, let go of it, and examine it again"


def examine_vehicle(source: OpenedVehicle, seconds: float) -> Iterator[Finding]:
    """Examine a vehicle's link, state and parameters, and `seconds` of its streams, while it stands still."""
    try:
        with source.connected(lambda _sentence: None) as link:
            put_down(source.listeners, lambda _sentence: None, STAND)
            yield _name(link)
            yield _version(link)
            yield _armed(link)
            yield _prearm(link)
            firmware = link.vehicle.family
            values = read_stream_parameters(link)
            yield from _streams(link, values, source.plan.config.rate_hz, seconds)
            level = read_parameters(link, trim_names(firmware))
    except SourceError as error:
        yield Finding.failed("link", error)
        return
    others = ", ".join(f"system {system}" for system in sorted(link.stations))
    what = f"{others} is here, too" if others else "none is heard"
    yield Finding.check("other stations", not others, what, STOP_IT, {"systems": sorted(link.stations)})
    yield from _filters(values)
    yield _level(firmware, level)


def _name(link: Link) -> Finding:
    m, vehicle = dialect(), link.vehicle
    known = m.enums["MAV_TYPE"].get(vehicle.type)
    kind = known.name.removeprefix("MAV_TYPE_").lower().replace("_", " ") if known else f"type {vehicle.type}"
    data = {"system": vehicle.system, "autopilot": vehicle.autopilot, "type": vehicle.type}
    return Finding("vehicle", Mark.OK, f"{vehicle}, {kind}", "", data)


def _version(link: Link) -> Finding:
    m = dialect()
    request = encode_command(link, m.MAV_CMD_REQUEST_MESSAGE, m.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    version = ask(link, request, lambda heard: heard if heard.get_type() == "AUTOPILOT_VERSION" else None)
    if version is None:
        return Finding("firmware", Mark.UNKNOWN, f"{link.vehicle.firmware} of an unknown version")
    words, commit = _words(version), bytes(version.flight_custom_version).rstrip(b"\0")
    # ArduPilot sends the characters of its commit, PX4 its bytes in reverse.
    built = commit.decode() if commit.isalnum() else commit[::-1].hex()
    what = f"{link.vehicle.firmware} {words}{f', commit {built}' if built else ''}"
    return Finding("firmware", Mark.OK, what, "", {"version": words, "commit": built})


def _words(version: Message) -> str:
    major, minor, patch, kind = version.flight_sw_version.to_bytes(4, "big")
    return f"{major}.{minor}.{patch}{next(word for least, word in KINDS if kind >= least)}"


def _armed(link: Link) -> Finding:
    armed = is_armed(link)
    remedy = "keep clear of its propellers and disarm it: nothing is written to an armed vehicle"
    return Finding.check("armed", not armed, "yes" if armed else "no", remedy, {"armed": armed}, Mark.BAD)


def _prearm(link: Link) -> Finding:
    state = check_prearm(link)
    mark = {True: Mark.OK, False: Mark.NOTE, None: Mark.UNKNOWN}[state.ready]
    return Finding("arming check", mark, f"it {state}", "", {"complaints": list(state.complaints)})


def _streams(link: Link, values: Values, rate_hz: float, seconds: float) -> Iterator[Finding]:
    """Examine the streams, and which parameters of each IMU a write would change."""
    firmware, said = link.vehicle.family, list[str]()
    log, clock = Log(firmware), HostClock()
    streams = Streams(link, firmware, values, rate_hz, said.append)
    first = streams.start()
    for name, value in values.items():
        log.add_parameter(name, value)
    begun_ns = heard_ns = link.now_ns()
    rebooted = False
    for message in link.messages(begun_ns + round(seconds * 1e9)):
        row, jump = log.add(message, link.now_ns())
        rebooted |= jump is Jump.REBOOT
        if row is not None and row.reading.stream == first:
            heard_ns = link.now_ns()
            clock.add(np.array([row.t_us * US]), np.array([heard_ns - begun_ns]))
        streams.watch()
    yield _loss(link)
    silent_s = (link.now_ns() - heard_ns) / 1e9
    if rebooted or silent_s > SILENT_S:
        what = "it rebooted while it was examined" if rebooted else f"nothing came in the last {silent_s:.0f} s"
        yield Finding("streams", Mark.BAD, what, "check its power and the link")
    yield from (Finding("rates", Mark.NOTE, sentence.removesuffix(".")) for sentence in said)
    if clock:
        fit = clock.fit()
        yield examine_clock("vehicle's clock", fit.ppm, fit.b_std)
    try:
        recording = log.recording("doctor")
    except RecordingError as error:
        yield Finding("streams", Mark.BAD, error.what, error.remedy)
        return
    for each in (recording, *recording.others):
        yield from _imu(each, rate_hz)


def _loss(link: Link) -> Finding:
    packets = link.received + link.lost
    what = f"{100 * link.loss_share:.1f} % of {packets} packets lost"
    data = {"packets": link.received, "lost": link.lost}
    return Finding.check("link", link.loss_share < LOSS_SHARE, what, "use a nearer or faster one", data)


def _imu(recording: Recording, asked_hz: float) -> Iterator[Finding]:
    """Examine one IMU's stream, its rest, and the parameters that hold its calibration."""
    of = recording.autopilot
    if of is None:
        raise TypeError("only a vehicle's recording has an IMU's number")
    topic = f"IMU {of.imu}"
    gaps, hz = int(recording.gap.sum()), recording.rate_hz
    data = {"message": of.message, "rate_hz": hz, "asked_hz": asked_hz, "gaps": gaps}
    what = f"{of.message} at {hz:.0f} Hz" + (f", with {gaps} gap{'s' if gaps > 1 else ''}" if gaps else "")
    remedy = "samples are missing: use a nearer or faster link, and end other ground stations"
    if slow := hz < SLOW_SHARE * asked_hz:
        remedy = f"{asked_hz:g} Hz were asked for: a faster link, fewer other messages, or a lower --rate"
    yield Finding.check(topic, not (slow or gaps), what, remedy, data)
    yield from _rest(topic, recording)
    slot = find_slot(of.firmware, of.imu, of.parameters)
    if slot is None:
        what = "no slot names its sensor (CAL_ACCn_ID), so nothing could be written"
        yield Finding(f"{topic}, a write", Mark.BAD, what, "give --prepare to the session, which has PX4 assign ids")
    else:
        yield _write(f"{topic}, a write", of.firmware, slot, of.parameters)


def _rest(topic: str, recording: Recording) -> Iterator[Finding]:
    if recording.flat is None:
        yield Finding(f"{topic}, at rest", Mark.UNKNOWN, "not examined", MOVED)
        return
    still = flat_statistics(recording, recording.flat)
    noise, step = np.sqrt(still.Sigma_a.max()), recording.sensor.steps[0]
    known = np.isfinite(recording.temperature_c)
    celsius = f", {recording.temperature_c[known].mean():.1f} °C" if known.any() else ""
    rounded = f" in steps of {step * MG_PER_MPS2:.0f} mg" if step else ""
    yield examine_gravity(f"{topic}, at rest", still.y, f", noise {noise * MG_PER_MPS2:.1f} mg{rounded}{celsius}")
    if still.rounded:
        what = f"its readings stay on one step of {step * MG_PER_MPS2:.0f} mg at rest, which no time makes finer"
        remedy = "hold the vehicle in your hands, whose tremor moves them, or raise INS_ACCEL_FILTER for the session"
        yield Finding(f"{topic}, rounding", Mark.NOTE, what, remedy)


def _write(topic: str, firmware: str, slot: Slot, values: Values) -> Finding:
    """Return the parameters that a write would change, as they are."""
    held = {name: values[name] for name in slot.names if name in values}
    sensor_id = values.get(slot.sensor_id)
    data = {**held, slot.sensor_id: sensor_id}
    if len(held) < len(slot.names):
        what = f"the vehicle did not send {', '.join(name for name in slot.names if name not in held)}"
        return Finding(topic, Mark.BAD, what, "check that the link goes both ways", data)
    if mounting(firmware, slot, values) is None:
        name = BOARD_ROTATION if firmware == PX4 else ORIENTATION
        what = f"the rotation of its board is unknown ({name} is {values.get(name)}), so nothing could be written"
        return Finding(topic, Mark.BAD, what, "set it to a known one, or use --no-write", data)
    listed = ", ".join(f"{name}={value:.4g}" for name, value in held.items())
    remedy = f"{slot.sensor_id} is 0: it has no calibration of this sensor yet"
    return Finding.check(topic, bool(sensor_id), f"would change {listed}", remedy, data)


def _filters(values: Values) -> Iterator[Finding]:
    held = {name: values[name] for name in FILTERS if name in values}
    if held:
        listed = " and ".join(f"{name} {value:.0f} Hz" for name, value in held.items())
        lag_ms = 1e3 * accel_lag_s(values)
        later = f"; accelerations come {lag_ms:+.0f} ms after rates, for which mpucal allows" if lag_ms else ""
        yield Finding("filters", Mark.OK, f"{listed}{later}", "", {**held, "accel_lag_ms": lag_ms})


def _level(firmware: str, values: Values) -> Finding:
    names = trim_names(firmware)
    if not set(names) <= set(values):
        return Finding("level", Mark.UNKNOWN, f"the vehicle did not send {names[0]} and the like")
    roll, pitch, _ = trim_of(firmware, values).tolist()
    if not (roll or pitch):
        what = f"never set ({names[0]} and {names[1]} are 0): a write leaves it, unless you say that it stands level"
    else:
        what = f"roll {roll:+.2f} and pitch {pitch:+.2f} deg: a write changes {names[0]} and {names[1]} to keep it"
    return Finding("level", Mark.OK, what, "", dict(values))
