"""The table of sinks: one row for each kind, from which options, help, error messages and documentation are made.

A new sink is a module that opens it and a row here. The module and its libraries are imported when such a sink is
opened.
"""

from __future__ import annotations

from ..origin import Origin
from ..result.session_files import SessionFile
from .kind import Effect, SinkKind

CHIP_OFFSETS = SessionFile("chip-offsets.json", "the content of a chip's offset registers before a write")
# N is the bridge's number of the blob
BRIDGE_BLOB = SessionFile("bridge-blob-N.bin", "the calibration in a bridge's memory before a write")
OLD_PARAM = SessionFile("autopilot_old.param", "an ArduPilot's parameters before a write")
OLD_PARAMS = SessionFile("autopilot_old.params", "a PX4's parameters before a write")
IIO_STATE = SessionFile("iio-state.json", "calibbias and the rule of udev before a write")

CHIP, KERNEL, BRIDGE, AUTOPILOT = "chip", "kernel", "bridge", "autopilot"

# a session writes in this order, so that later sinks get the calibration that earlier ones leave
SINKS = {
    kind.name: kind
    for kind in (
        SinkKind(
            CHIP,
            fits=lambda source: source.origin is Origin.CHIP,
            where="the chip's offset registers",
            holds="only b_a, in steps of 1 mg, until the next power cycle or reset",
            opener="mpucal.sinks.chip:open_chip",
            effect=Effect.LESS_BIAS,
            kept=(CHIP_OFFSETS,),
        ),
        SinkKind(
            KERNEL,
            fits=lambda source: source.option.name == "iio",
            where="the kernel's driver",
            holds="D as ACCEL_MOUNT_MATRIX of udev; b_a in calibbias of an MPU-6050, until its next power cycle",
            opener="mpucal.iio_device.sink:open_kernel",
            effect=Effect.LESS_BIAS,
            kept=(IIO_STATE,),
        ),
        SinkKind(
            BRIDGE,
            fits=lambda source: bool(source.store),
            default=True,
            where="the bridge's memory",
            holds="the config blob: D, b_a, K, b_omega, and b_a(T) if known",
            opener="mpucal.bridge.sink:open_bridge",
            kept=(BRIDGE_BLOB,),
        ),
        SinkKind(
            AUTOPILOT,
            fits=lambda source: source.origin is Origin.VEHICLE,
            default=True,
            where="the autopilot",
            holds="offsets and scales; without cross-axis terms, and mpucal prints the error that remains",
            opener="mpucal.vehicle.sink:open_autopilot",
            effect=Effect.OTHER_STREAM,
            kept=(OLD_PARAM, OLD_PARAMS),
        ),
    )
}
