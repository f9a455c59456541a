"""Records of a capture, in their order: register accesses and session events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

# Names of session events. KEY holds the key under its own name; LATE: an answer was late; FORGET: samples
# first..last-1 are not used; RESUMED: the session was resumed, and had stopped at the time SAMPLED_NS of the samples'
# clock; UTC: the time of day, ns since 1970.
KEY, LATE, FORGET, RESUMED, UTC = "key", "late", "forget", "resumed", "utc"
SAMPLED_NS = "sampled_ns"
# Of a vehicle: the link was opened; what it sends counts from here on; reading had paused, see SAMPLED_NS; nothing came
# until this time.
OPENED, BEGUN, PAUSED, END = "session", "begun", "paused", "end"
ABORT = "abort"  # the key that ends a session


@dataclass(frozen=True)
class SessionEvent:
    """Event that reached the session by another way than the bus: a key press, an option, the end.

    Attributes
    ----------
    name : kind of the event. t_ns : time of the bus's clock. data : of JSON's types.
    """

    name: str
    t_ns: int
    data: Mapping[str, Any] = field(default_factory=dict)
