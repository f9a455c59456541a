"""Draw the session's states into docs/session.md, from the table that runs them.

python -m tools.make draw_session            write the diagram
python -m tools.make draw_session --check    exit 1 where the document shows another one
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import defaultdict
from pathlib import Path

from mpucal.session.events import Abort
from mpucal.session.table import TRANSITIONS, State

DOCUMENT = Path(__file__).parents[2] / "docs" / "session.md"
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


def _id(state: State) -> str:
    return state.name.lower()


def main() -> int:
    """Write or check; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    arguments = parser.parse_args()
    old = DOCUMENT.read_text(encoding="utf-8")
    new = DIAGRAM.sub(lambda _: diagram(), old)
    if not arguments.check:
        DOCUMENT.write_text(new, encoding="utf-8")
    elif new != old:
        print(f"{DOCUMENT} is not drawn from the table: run tools/make/draw_session.py", file=sys.stderr)
        return 1
    return 0
