"""A bridge against the golden talks of firmware_protocol.md, whatever board and firmware it is."""

from __future__ import annotations

from collections.abc import Iterator

from ..sources.bridge.conformance import Talk, converse, talks
from ..sources.bridge.link import REPLY_NS, STORE_NS, Link
from ..sources.bridge.messages import BlobErase, BlobState, Feature, Status
from .finding import Finding, Mark

REMEDY = "firmware_protocol.md says what is settled; `python -m tools.make vectors` writes the talks"


def examine_conformance(link: Link) -> Iterator[Finding]:
    """A finding for each talk that the bridge can have; it was greeted, and what it stores is left as it is.

    Raises
    ------
    BusError : it does not answer any more.
    """
    hello = link.bridge
    has = {"chip": bool(hello.address), "stream": bool(hello.features & Feature.STREAM), "blob": False}
    why = {"chip": "no chip answers", "stream": "it pushes no samples", "blob": "it stores no calibration"}
    if hello.features & Feature.BLOB:
        # what a talk stores would take the place of what is stored
        has["blob"] = link.ask(BlobState())[0][-1].reply.status == Status.NO_BLOB
        why["blob"] = "a calibration is stored there, which stays"
    for name, talk in talks().items():
        lacks = [why[need] for need in talk["needs"] if not has[need]]
        if lacks:
            yield Finding(name, Mark.UNKNOWN, f"not tried, as {lacks[0]}: {talk['settled']}")
            continue
        yield _had(link, name, talk)


def _had(link: Link, name: str, talk: Talk) -> Finding:
    stores = "blob" in talk["needs"]
    # no matter which address a talk has left
    link.greet()
    differs = converse(link.port, talk, (STORE_NS if stores else REPLY_NS) + link.latency.most_ns)
    link.greet()
    if stores:
        link.ask(BlobErase())
    if differs:
        return Finding(name, Mark.BAD, f"{differs}; settled is: {talk['settled']}", REMEDY)
    return Finding(name, Mark.OK, talk["settled"])
