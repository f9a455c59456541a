"""Conformance of a bridge's firmware to the golden talks of firmware_protocol.md, on any board."""

from __future__ import annotations

from collections.abc import Iterator

from ..sources.bridge.conformance import Talk, run_talk, talks
from ..sources.bridge.link import REPLY_NS, STORE_NS, Link
from ..sources.bridge.messages import BlobErase, BlobState, Feature, Status
from .finding import Finding, Mark

REMEDY = "firmware_protocol.md has the rule; `python -m tools.make vectors` writes the talks"


def examine_conformance(link: Link) -> Iterator[Finding]:
    """Run each talk that this bridge can hold, over an open link; a stored calibration is not overwritten.

    Raises
    ------
    BusError : it does not answer any more.
    """
    hello = link.bridge
    has = {"chip": bool(hello.address), "stream": bool(hello.features & Feature.STREAM), "blob": False}
    why = {"chip": "no chip answers", "stream": "it pushes no samples", "blob": "it stores no calibration"}
    if hello.features & Feature.OCCUPIED:
        why["blob"] = "its memory holds other data, which is kept"
    elif hello.features & Feature.BLOB:
        # The talks about storing would overwrite a stored calibration.
        has["blob"] = link.ask(BlobState())[0][-1].reply.status == Status.NO_BLOB
        why["blob"] = "it stores a calibration, which is kept"
    for name, talk in talks().items():
        lacks = [why[need] for need in talk["needs"] if not has[need]]
        if lacks:
            yield Finding(name, Mark.UNKNOWN, f"not tried, as {lacks[0]}: {talk['settled']}")
        else:
            yield _run_talk(link, name, talk)


def _run_talk(link: Link, name: str, talk: Talk) -> Finding:
    stores = "blob" in talk["needs"]
    # A talk before may have left another address.
    link.greet()
    differs = run_talk(link.port, talk, (STORE_NS if stores else REPLY_NS) + link.latency.most_ns)
    link.greet()
    if stores:
        link.ask(BlobErase())
    what = f"{differs}; the rule is: {talk['settled']}" if differs else talk["settled"]
    return Finding.check(name, not differs, what, REMEDY, {}, Mark.BAD)
