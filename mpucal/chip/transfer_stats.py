"""How many transfers a bus made, how many were repeated, and what kinds of errors they met."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ..errors import BusError, BusHeld, LinkError, NoAnswer

ON_THE_LINK = "lost on the link to the board"
KINDS = {NoAnswer: "not acknowledged", BusHeld: "timed out", LinkError: ON_THE_LINK}
OTHER = "broken off"
REMEDY = "shorten the wires, keep them away from motors, add pull-ups of 2.2 to 4.7 kΩ, or run the bus at 100 kHz"
LINK_REMEDY = "not the sensor's wires are to blame: check the board's cable and supply, or the network in between"


@dataclass
class TransferStats:
    """The transfers with one chip.

    Attributes
    ----------
    transfers : all, failed ones too. retries : repeated after an error. errors : by kind, in words.
    """

    transfers: int = 0
    retries: int = 0
    errors: Counter[str] = field(default_factory=Counter)

    def failed(self, error: BusError) -> None:
        """A transfer failed."""
        self.errors[next((word for kind, word in KINDS.items() if isinstance(error, kind)), OTHER)] += 1

    @property
    def share(self) -> float:
        """Of the transfers, those that failed."""
        return self.errors.total() / max(1, self.transfers)

    @property
    def remedy(self) -> str:
        """Of the kind that was met most."""
        worst = self.errors.most_common(1)
        return LINK_REMEDY if worst and worst[0][0] == ON_THE_LINK else REMEDY

    def __str__(self) -> str:
        """A clause, such as: 12 of 5030 transfers failed (0.24 %: 12 not acknowledged), 11 were repeated."""
        failed = self.errors.total()
        if not failed:
            return f"none of {self.transfers} transfers failed"
        kinds = ", ".join(f"{number} {word}" for word, number in self.errors.most_common())
        share = f"{100 * self.share:.2g} %"
        return f"{failed} of {self.transfers} transfers failed ({share}: {kinds}), {self.retries} repeated"
