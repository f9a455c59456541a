"""Draws the session's states into docs/session.md, from the table that runs them."""

from __future__ import annotations

import re
from collections import defaultdict

from mpucal.session.events import Abort
from mpucal.session.table import TRANSITIONS, State

DIAGRAM = re.compile(r"(?<=```mermaid\n).*?(?=```)", re.DOTALL)
INDENT = "    "


def diagram() -> str:
    """The table as a Mermaid state diagram; events that change nothing are left out."""
    lines = ["stateDiagram-v2", f"{INDENT}[*] --> {_id(State.CONNECT)}"]
    lines += [f"{INDENT}{_id(state)}: {state}" for state in State]
    for state, row in TRANSITIONS.items():
        events = defaultdict(list)
        for event, following in row.items():
            if following is not state:
                events[following].append(event.__name__)
        lines += [f"{INDENT}{_id(state)} --> {_id(to)}: {', '.join(names)}" for to, names in events.items()]
        if Abort not in row:  # an end
            lines.append(f"{INDENT}{_id(state)} --> [*]")
    return "\n".join(lines) + "\n"


def page(old: str) -> str:
    """The document with the diagram of the table as it is now."""
    return DIAGRAM.sub(lambda _: diagram(), old)


def _id(state: State) -> str:
    return state.name.lower()
