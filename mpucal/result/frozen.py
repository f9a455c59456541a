"""A dict that is read and copied, and never changed; unlike a mapping proxy it pickles, copies and dumps as JSON."""

from __future__ import annotations

from typing import Any, NoReturn


class FrozenDict(dict[str, Any]):
    """A dict of which every change raises TypeError; `dict(it)` is one that can be changed."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("this mapping does not change: make a dict of it")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[type[FrozenDict], tuple[dict[str, Any]]]:
        """How it pickles, and is copied: without setting items one by one."""
        return FrozenDict, (dict(self),)
