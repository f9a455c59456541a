"""Statistics of a bus's transfers: their number, the retries, and the kinds of errors."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ..errors import BusError, BusHeld, LateRead, LinkError, NoAnswer

ON_THE_LINK, LATE = "lost on the link to the board", "delayed by this computer"
KINDS = {NoAnswer: "not acknowledged", BusHeld: "timed out", LateRead: LATE, LinkError: ON_THE_LINK}
OTHER_KIND = "broken off"
REMEDY = "shorten the wires, keep them away from motors, add pull-ups of 2.2 to 4.7 kΩ, or run the bus at 100 kHz"
LATE_REMEDY = "end other programs on this computer, or start mpucal with a higher priority"
OTHER_REMEDIES = {
    ON_THE_LINK: "the sensor's wires are not the cause: check the board's cable and supply, or the network in between",
    LATE: LATE_REMEDY,
}


@dataclass
class TransferStats:
    """Counters of the transfers with one chip.

    Attributes
    ----------
    transfers : all, failed ones too. retries : transfers repeated after an error. errors : by kind, in words.
    """

    transfers: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)

    def count_error(self, error: BusError) -> None:
        """Count a failed transfer."""
        self.errors[next((word for kind, word in KINDS.items() if isinstance(error, kind)), OTHER_KIND)] += 1

    @property
    def error_share(self) -> float:
        """Share of the transfers that failed."""
        return self.errors.total() / max(1, self.transfers)

    @property
    def remedy(self) -> str:
        """Remedy for the most frequent kind of error."""
        worst = self.errors.most_common(1)
        return OTHER_REMEDIES.get(worst[0][0], REMEDY) if worst else REMEDY

    def __str__(self) -> str:
        """Return a clause, such as: 12 of 5030 transfers failed (0.24 %: 12 not acknowledged), 11 repeated."""
        failed = self.errors.total()
        if not failed:
            return f"none of {self.transfers} transfers failed"
        kinds = ", ".join(f"{number} {word}" for word, number in self.errors.most_common())
        share = f"{100 * self.error_share:.2g} %"
        return f"{failed} of {self.transfers} transfers failed ({share}: {kinds}), {self.retries} repeated"
