"""Errors of a bridge as (what happened, remedy); {port} stands for the port's name."""

from __future__ import annotations

from .messages import MAJOR, HelloReply, Reply, Status

WIRES = "check the chip's supply, SDA, SCL and AD0"

SENTENCES: dict[int, tuple[str, str]] = {
    Status.UNKNOWN_TYPE: ("the bridge on {port} does not know this request", "put a newer firmware on it"),
    Status.BAD_PAYLOAD: ("the bridge on {port} refuses a request's values", "put a firmware of this version on it"),
    Status.NO_ANSWER: ("the chip no longer answers the bridge on {port}", WIRES),
    Status.BUS_FAILED: (
        "a transfer on the I2C bus of the bridge on {port} broke off",
        "shorten the wires, or add pull-ups",
    ),
    Status.NO_BLOB: (
        "the bridge on {port} stores no calibration",
        "store one: mpucal write CALIBRATION bridge --serial {port}",
    ),
    Status.BAD_BLOB: ("the bridge on {port} received a calibration that is not valid", "try again"),
    Status.BAD_OFFSET: ("the bridge on {port} missed a part of the calibration", "try again"),
    Status.NO_ROOM: ("the memory of the bridge on {port} is too small for the calibration", "use another board"),
    Status.NOT_BEGUN: ("the bridge on {port} was reset while it received the calibration", "try again"),
    Status.OCCUPIED: (
        "the memory of the bridge on {port} holds other data",
        "choose another place with MPUCAL_EEPROM_AT in the sketch, or overwrite it:"
        " mpucal write CALIBRATION bridge --serial {port}",
    ),
    Status.STORAGE_FAILED: ("the memory of the bridge on {port} does not keep what is written", "use another board"),
}


def request_failed(port: str, status: int) -> tuple[str, str]:
    """Describe a request that failed with `status`."""
    unknown = f"the bridge on {{port}} answers with status {status}", "put a newer mpucal on this machine"
    what, remedy = SENTENCES.get(status, unknown)
    return what.format(port=port), remedy.format(port=port)


def no_chip(port: str, address: int | None) -> tuple[str, str]:
    """Describe a bridge that finds no chip."""
    at = f"0x{address:02x}" if address else "0x68 or 0x69"
    return f"the bridge on {port} answers, but no chip answers it at {at} on its I2C bus", WIRES


def no_reply(port: str) -> tuple[str, str]:
    """Describe a bridge that does not reply."""
    return f"the bridge on {port} no longer answers", "check its cable and supply, then start again"


def flooded(port: str) -> tuple[str, str]:
    """Describe a port with more bytes than any bridge sends, and no answer among them."""
    return (
        f"{port} is flooded: far more bytes come than a bridge sends, and no answer among them",
        "check that the bridge, and nothing else, is on that port, and plug it in again",
    )


def restarted(port: str) -> tuple[str, str]:
    """Describe a bridge that forgot the greeting."""
    return f"the bridge on {port} was reset", "check its cable and supply"


def without_blob(port: str) -> tuple[str, str]:
    """Describe a bridge without a memory for a blob."""
    return f"the bridge on {port} cannot store a calibration", "keep calibration.bin where its firmware reads it"


def not_readable(port: str, why: str) -> tuple[str, str]:
    """Describe a stored blob that the bridge accepts, but that is not valid."""
    return f"the data that the bridge on {port} stores is not a calibration ({why})", "store one again"


def other_version(port: str, reply: Reply) -> tuple[str, str]:
    """Describe a bridge of another major version."""
    theirs = reply.major if isinstance(reply, HelloReply) else 0
    what = f"the bridge on {port} speaks version {theirs} of the protocol, and mpucal {MAJOR}"
    return what, "put a newer mpucal on this machine" if theirs > MAJOR else "put a newer firmware on the bridge"
