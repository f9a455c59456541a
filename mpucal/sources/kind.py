"""Description of a kind of source: its name, its options and its opener."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..origin import Origin

if TYPE_CHECKING:
    from ..session.plan import Plan

# Key of the board's name, besides the options of its source.
NAME = "name"


class Option(NamedTuple):
    """Option of the command line.

    Attributes
    ----------
    name : accel_range for --accel-range. metavar : shown for its value in the help.
    parse : converts its text to a value, or raises ValueError with a sentence. choices : possible texts.
    bare : text of the option without a value; None: it needs one.
    """

    name: str
    help: str = ""
    metavar: str | None = None
    parse: Callable[[str], Any] = str
    choices: tuple[str, ...] = ()
    default: Any = None
    bare: str | None = None

    @property
    def flag(self) -> str:
        """Spelling on the command line."""
        return f"--{self.name.replace('_', '-')}"

    def words(self, value: Any) -> list[str]:
        """Return the words of a command line that give the option this value."""
        return [self.flag] if value == self.bare else [self.flag, str(value)]


class SourceKind(NamedTuple):
    """Kind of source: one row of the table.

    Attributes
    ----------
    what : description. option : selects it on the command line; several kinds may share one.
    forms : forms of the option's value, for the help.
    opener : "module:attribute" of a function from a Request to an OpenedSource; imported when it is called.
    origin : of its samples. options : they identify the source besides `option`. settings : they configure its sensor.
    word : selects this kind if the option's value is this word, or begins with it and a colon.
    instead : commands that read it and take no source.
    title : title of a session on it; {} is the option's value.
    store : "module:attribute" of a context manager from the options' values to a memory for a calibration, as in
        mpucal.bridge; empty: there is none.
    doctor : "module:attribute" of its examination, from an OpenedSource and seconds to findings; empty: none.
    host : "module:attribute" of the examination of this computer before it is opened, from the option's value.
    found : "module:attribute" of a function that lists those there are: (the option's value, description); empty: none.
    """

    what: str
    option: Option
    forms: str
    opener: str
    origin: Origin
    options: tuple[Option, ...] = ()
    settings: tuple[Option, ...] = ()
    word: str = ""
    instead: str = ""
    title: str = "{}"
    store: str = ""
    doctor: str = ""
    host: str = ""
    found: str = ""

    @property
    def flag(self) -> str:
        """Spelling on the command line: `--bus sim`."""
        return f"{self.option.flag} {self.word}".strip()

    @property
    def commands(self) -> tuple[str, ...]:
        """Commands that take it."""
        live = () if self.origin is Origin.FILE else ("stream", "write", "show")
        return ("session", "record", "check", "noise", *live, *(("doctor",) if self.doctor else ()))

    def matches(self, values: Mapping[str, Any]) -> bool:
        """Return True if the options' values name a source of this kind."""
        value = values.get(self.option.name)
        return value is not None and self.word in ("", str(value).partition(":")[0])


@dataclass(frozen=True)
class Request:
    """Request to open a source.

    Attributes
    ----------
    values : of all options, by name. plan : of the session.
    given : options on the command line as they were written, by name; empty without a command line.
    """

    kind: SourceKind
    values: Mapping[str, Any]
    plan: Plan
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def value(self) -> Any:
        """Value of the option that selects the source."""
        return self.values[self.kind.option.name]

    @property
    def words(self) -> dict[str, Any]:
        """Options that open the same source again, in JSON's types, and the board's name if it has one."""
        names = (self.kind.option.name, *(option.name for option in self.kind.options))
        words = {name: self.values.get(name) for name in names}
        board = {NAME: self.values[NAME]} if self.values.get(NAME) else {}
        return {key: str(word.absolute()) if isinstance(word, Path) else word for key, word in words.items()} | board
