"""Frozen dataclasses as the standard library's, which come into being in a quarter of the time.

The standard library compiles six methods for each class. A command loads some 150 of these classes, which took a tenth
of a session's time. Here only __init__ is compiled, and the classes share the other methods. Type checkers see the
standard library's decorator.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterable
from dataclasses import MISSING, Field, FrozenInstanceError
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

PARAMETERS = "__dataclass_params__"

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls: type | None = None, *, frozen: bool = False, eq: bool = True, repr: bool = True) -> Any:
        """Make a dataclass, as dataclasses.dataclass does."""

        def made(cls: type) -> type:
            return _frozen(cls, eq, repr) if frozen else dataclasses.dataclass(eq=eq, repr=repr)(cls)

        return made if cls is None else made(cls)


def _frozen(cls: Any, eq: bool, shown: bool) -> Any:
    bases = [vars(base)[PARAMETERS] for base in cls.__mro__[1:] if PARAMETERS in vars(base)]
    # The standard library derives no class from a frozen one unless it makes that frozen, too.
    _mark(bases, False)
    made = dataclasses.dataclass(init=False, eq=False, repr=False)(cls)
    _mark([*bases, vars(made)[PARAMETERS]], True)
    methods: dict[str, Any] = {"__init__": _init(made), "__setattr__": _refuse_to_set, "__delattr__": _refuse_to_delete}
    if shown:
        methods["__repr__"] = _repr
    if eq:
        methods |= {"__eq__": _equals, "__hash__": _hash}
    own = vars(made)
    for name, method in methods.items():
        # Python sets __hash__ to None in a class with an __eq__ of its own.
        if own.get(name) is None:
            setattr(made, name, method)
    return made


def _mark(classes: Iterable[Any], frozen: bool) -> None:
    for parameters in classes:
        parameters.frozen = frozen


def _init(cls: Any) -> Callable[..., None]:
    """Compile __init__, whose parameters are the fields in their order."""
    fields = dataclasses.fields(cls)
    taken = [f"{field.name}{'' if _is_needed(field) else f'=default_{field.name}'}" for field in fields]
    lines = ["set_ = object.__setattr__"]
    for field in fields:
        made = "" if field.default_factory is MISSING else f" if {field.name} is not MISSING else make_{field.name}()"
        lines.append(f"set_(self, {field.name!r}, {field.name}{made})")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    known: dict[str, Any] = {"MISSING": MISSING}
    for field in fields:
        known |= {f"default_{field.name}": field.default, f"make_{field.name}": field.default_factory}
    body = "\n  ".join(lines)
    text = f"def make({', '.join(known)}):\n def __init__(self, {', '.join(taken)}):\n  {body}\n return __init__"
    scope: dict[str, Any] = {}
    exec(text, sys.modules[cls.__module__].__dict__, scope)
    init: Callable[..., None] = scope["make"](**known)
    init.__qualname__ = f"{cls.__qualname__}.__init__"
    init.__annotations__ = {**{field.name: field.type for field in fields}, "return": None}
    return init


def _is_needed(field: Field[Any]) -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _values(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, name) for name in self.__match_args__)


def _equals(self: Any, other: object) -> bool:
    return _values(self) == _values(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_values(self))


def _repr(self: Any) -> str:
    shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.__match_args__)
    return f"{type(self).__qualname__}({shown})"


def _refuse_to_set(_self: object, name: str, _value: object) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(_self: object, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")
