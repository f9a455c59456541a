"""What the program asks of a kind of source: how it is named, what belongs to it, and what opens it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..session.plan import Plan

# of the board, beside the options of its source
NAME = "name"


@dataclass(frozen=True)
class Option:
    """One option of the command line.

    Attributes
    ----------
    name : accel_range, of --accel-range. metavar : what the help shows for its value.
    parse : the value of its text; ValueError with a sentence where that is none. choices : the texts it can be.
    bare : its text where it is given without one; None: it needs one.
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
        """As a person writes it."""
        return f"--{self.name.replace('_', '-')}"


class Delivery(Enum):
    """What comes out of a source."""

    REGISTERS = "a chip's registers"
    SAMPLES = "samples"
    CAPTURE = "what was recorded"


@dataclass(frozen=True)
class SourceKind:
    """A kind of source: one row of the table.

    Attributes
    ----------
    what : of which kind it is, in words. option : names it on the command line; several kinds may share one.
    forms : what the option's value looks like, for the help.
    opener : "module:attribute" of a function from a Request to an OpenedSource; imported when it is called.
    delivers : a session on registers can go on after an interruption. What opens another than a capture has besides
        `contents() -> dict`: what the sensor holds now, in JSON's own types, `where` among them.
    options : belong to it, and name the source beside `option`. settings : how its sensor can be set.
    word : it is meant where the option's value is this, or begins with it and a colon.
    beside : it is meant where this one of its `options` is given.
    instead : which commands read it that take no source.
    title : of a session on it; {} is the option's value.
    store : "module:attribute" of a context manager from the options' values to a memory that keeps a calibration, as
        mpucal.sources.bridge has it; empty where there is none.
    doctor : "module:attribute" of what examines it, from an OpenedSource and seconds to findings; empty: nothing does.
    host : the same of what examines this computer's side of it before it is opened, from the option's value.
    """

    what: str
    option: Option
    forms: str
    opener: str
    delivers: Delivery
    options: tuple[Option, ...] = ()
    settings: tuple[Option, ...] = ()
    word: str = ""
    beside: str = ""
    instead: str = ""
    title: str = "{}"
    store: str = ""
    doctor: str = ""
    host: str = ""

    @property
    def flag(self) -> str:
        """As a person writes it: `--bus sim`."""
        beside = next((option.flag for option in self.options if option.name == self.beside), "")
        return " ".join(filter(None, (self.option.flag, self.word, beside)))

    @property
    def commands(self) -> tuple[str, ...]:
        """Which take it."""
        live = () if self.delivers is Delivery.CAPTURE else ("stream", "write", "show")
        return ("session", "record", "check", "noise", *live, *(("doctor",) if self.doctor else ()))

    def matches(self, values: Mapping[str, Any]) -> bool:
        """Whether the options' values name a source of this kind."""
        value = values.get(self.option.name)
        if value is None or (self.beside and values.get(self.beside) is None):
            return False
        return not self.word or str(value).partition(":")[0] == self.word


@dataclass(frozen=True)
class Request:
    """A source that is to be opened.

    Attributes
    ----------
    values : of all options, by name. plan : what to do with it.
    given : the options that the person wrote, by name, as they were written; empty where no person did.
    """

    kind: SourceKind
    values: Mapping[str, Any]
    plan: Plan
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def value(self) -> Any:
        """Of the option that names the source."""
        return self.values[self.kind.option.name]

    @property
    def words(self) -> dict[str, Any]:
        """What opens the same source again, in JSON's own types, and what the board is called, if anything."""
        names = (self.kind.option.name, *(option.name for option in self.kind.options))
        called = {NAME: self.values[NAME]} if self.values.get(NAME) else {}
        return {**{name: self.values.get(name) for name in names}, **called}
