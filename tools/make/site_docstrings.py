"""The documentation site: the docstrings' `name : what it is`, made into the name and text that numpydoc has."""

from __future__ import annotations

import re
from typing import Any

import griffe

SECTION = re.compile(r"^ *(Parameters|Attributes|Raises)\n *-+\n(.*?)(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
# several may share a line: "acc : (n, 3) m/s^2. gyr : (n, 3) rad/s."
ITEM = re.compile(r"(?:^ *|(?<=[.;] ))((?:\w+, )*\w+) : ", re.MULTILINE)


class ProjectDocstrings(griffe.Extension):
    """Gives each argument, attribute or error a line of its own, and its text the line below."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Rewrite an object's docstring."""
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_items, obj.docstring.value)


def _items(section: re.Match[str]) -> str:
    _, *parts = ITEM.split(section[2])
    items = [f"{name}\n    {' '.join(text.split())}" for name, text in zip(parts[::2], parts[1::2], strict=True)]
    return f"{section[1]}\n{'-' * len(section[1])}\n" + "\n".join(items)
