"""Table of the ways in which transfers and samples are lost or late, with what to do about each; and their count."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum

from ..errors import BusError, BusHeld, LateRead, LinkError, NoAnswer

BUSY = "end other programs on this computer, start mpucal with a higher priority, or use a lower --rate"
WIRES = "shorten the wires, keep them away from motors, add pull-ups of 2.2 to 4.7 kΩ, or run the bus at 100 kHz"
SUPPLY = "its supply breaks down: check wires, connectors, and motors on the same supply, then start again"
WORN = "switch its supply off and on, check its solder joints and start again; if it happens again, replace the chip"
LINE = "the sensor's wires are not the cause: check the board's cable and supply, or the network in between"


class Loss(StrEnum):
    """Way in which something is lost or late.

    Attributes
    ----------
    value : its name; of a transfer, the word for "12 of 5030 transfers failed". remedy : for the user.
    what : clause on what happened to samples.
    """

    remedy: str
    what: str

    def __new__(cls, name: str, remedy: str, what: str = "") -> Loss:
        """Make a row of the table; the member is its name."""
        row = str.__new__(cls, name)
        row._value_, row.remedy, row.what = name, remedy, what
        return row

    # The bytes read from the FIFO are discarded.
    OVERFLOW = "overflow", BUSY, "the FIFO overflowed: it was read too late"
    LATE = "late", BUSY, "a sample was read too late"
    MISALIGNED = "misaligned", WIRES, "the frames in the FIFO slipped"
    STUCK = "stuck", WORN, "the sensor repeated itself"
    RESET = "lost its settings", SUPPLY, "the chip lost its settings: it was reset"
    # The kernel leaves samples out.
    KERNEL = "kernel", BUSY, "the kernel's buffer overran, or the trigger fired late"
    # A word of a sample is repaired.
    FLIPPED = "flipped", WIRES
    # A transfer fails.
    NO_ANSWER = "not acknowledged", WIRES
    HELD = "timed out", WIRES
    BROKEN = "broken off", WIRES
    DELAYED = "delayed by this computer", BUSY
    LINK = "lost on the link to the board", LINE


KINDS = {NoAnswer: Loss.NO_ANSWER, BusHeld: Loss.HELD, LateRead: Loss.DELAYED, LinkError: Loss.LINK}


def remedy_of(losses: Counter[Loss]) -> str:
    """Return the remedy for the most frequent loss."""
    return losses.most_common(1)[0][0].remedy if losses else WIRES


@dataclass
class TransferStats:
    """Counters of the transfers with one chip.

    Attributes
    ----------
    transfers : all, failed ones too. retries : transfers repeated after an error. errors : by kind.
    """

    transfers: int = 0
    retries: int = 0
    errors: Counter[Loss] = field(default_factory=Counter)

    def count_error(self, error: BusError) -> None:
        """Count a failed transfer."""
        self.errors[next((loss for kind, loss in KINDS.items() if isinstance(error, kind)), Loss.BROKEN)] += 1

    @property
    def error_share(self) -> float:
        """Share of the transfers that failed."""
        return self.errors.total() / max(1, self.transfers)

    def __str__(self) -> str:
        """Return a clause, such as: 12 of 5030 transfers failed (0.24 %: 12 not acknowledged), 11 repeated."""
        failed = self.errors.total()
        if not failed:
            return f"none of {self.transfers} transfers failed"
        kinds = ", ".join(f"{number} {loss}" for loss, number in self.errors.most_common())
        share = f"{100 * self.error_share:.2g} %"
        return f"{failed} of {self.transfers} transfers failed ({share}: {kinds}), {self.retries} repeated"
