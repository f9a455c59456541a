"""The table of sinks: one row for each kind, from which options, help, error messages and documentation are made.

A new sink is a module that opens it and a row here. The module, and the library behind it, are imported when a sink of
that kind is opened.
"""

from __future__ import annotations

from ..result.session_files import SessionFile
from ..sources.kind import Delivery
from ..sources.table import IIO, MAVLINK
from .kind import Effect, Flag, SinkKind

CHIP_OFFSETS = SessionFile("chip-offsets.json", "what a chip's offset registers held before a write")
# N is the number that the bridge gave it
BRIDGE_BLOB = SessionFile("bridge-blob-N.bin", "the calibration that a bridge's memory held before a write")
OLD_PARAM = SessionFile("autopilot_old.param", "what an ArduPilot's parameters were before a write")
OLD_PARAMS = SessionFile("autopilot_old.params", "what a PX4's parameters were before a write")
IIO_STATE = SessionFile("iio-state.json", "what calibbias and the rule of udev were before a write")

CHIP, KERNEL, BRIDGE, AUTOPILOT = "chip", "kernel", "bridge", "autopilot"

# by name; a session writes to them in this order, so that what is written later says what an earlier one applies
SINKS = {
    kind.name: kind
    for kind in (
        SinkKind(
            CHIP,
            behind=lambda source: source.delivers is Delivery.REGISTERS,
            where="the chip's offset registers",
            holds="b_a alone, in steps of 1 mg, until the chip's supply goes",
            opener="mpucal.sinks.chip:open_chip",
            effect=Effect.LESS_BIAS,
            kept=(CHIP_OFFSETS,),
        ),
        SinkKind(
            KERNEL,
            behind=lambda source: source.option is IIO,
            where="the kernel's driver",
            holds="D as ACCEL_MOUNT_MATRIX of udev; b_a in calibbias of an MPU-6050, until its supply goes",
            opener="mpucal.sinks.iio:open_kernel",
            effect=Effect.LESS_BIAS,
            kept=(IIO_STATE,),
        ),
        SinkKind(
            BRIDGE,
            behind=lambda source: bool(source.store),
            default=True,
            where="the bridge's memory",
            holds="the config blob: D, b_a, K, b_omega, and b_a(T) where it is known",
            opener="mpucal.sinks.bridge:open_bridge",
            kept=(BRIDGE_BLOB,),
        ),
        SinkKind(
            AUTOPILOT,
            behind=lambda source: source.option is MAVLINK,
            default=True,
            where="the autopilot",
            holds="offsets and scales; cross-axis terms stay, and it says what error that leaves",
            opener="mpucal.sinks.autopilot:open_autopilot",
            effect=Effect.OTHER_STREAM,
            kept=(OLD_PARAM, OLD_PARAMS),
            flags=(Flag("store", "keep D in the vehicle's storage too."),),
        ),
    )
}
