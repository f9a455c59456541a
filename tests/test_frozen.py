"""Frozen dataclasses, beside the standard library's."""

import dataclasses
import inspect
import pickle
from dataclasses import field, fields, replace

import pytest

from mpucal import frozen


def kinds(dataclass):
    """A class with each kind of field, one derived from it, one that compares by identity, and one with its own eq."""

    @dataclass(frozen=True)
    class Base:
        name: str
        count: int = 3
        items: list = field(default_factory=list)

        def __post_init__(self):
            object.__setattr__(self, "name", self.name.upper())

    @dataclass(frozen=True)
    class Derived(Base):
        more: float | None = None

    @dataclass(frozen=True, eq=False, repr=False)
    class Plain:
        value: int

    @dataclass(frozen=True)
    class Own:  # noqa: PLW1641 - the decorator adds it
        value: int

        def __eq__(self, other):
            return True

        def __repr__(self):
            return "own"

    return Base, Derived, Plain, Own


@pytest.fixture(params=[dataclasses.dataclass, frozen.dataclass], ids=["standard", "ours"])
def made(request):
    return kinds(request.param)


def test_has_fields_defaults_and_a_signature(made):
    Base, Derived, *_ = made
    assert (Base("a").name, Base("a").count, Base("a").items) == ("A", 3, [])
    assert Base("a").items is not Base("a").items
    assert Base("a", items=None).items is None
    assert [each.name for each in fields(Derived)] == ["name", "count", "items", "more"]
    assert Derived.__match_args__ == ("name", "count", "items", "more")
    assert [*inspect.signature(Derived).parameters] == ["name", "count", "items", "more"]
    assert inspect.get_annotations(Derived.__init__)["more"] == float | None
    with pytest.raises(TypeError, match=r"__init__\(\) missing 1 required positional argument: 'name'"):
        Base()
    assert dataclasses.asdict(replace(Derived("a", more=2.0), count=4)) == {
        "name": "A",
        "count": 4,
        "items": [],
        "more": 2.0,
    }


def test_compares_and_shows_its_values(made):
    Base, Derived, Plain, Own = made
    assert Base("a") == Base("A") != Base("b")
    assert Base("a") != Derived("a")
    assert repr(Derived("a")).endswith("Derived(name='A', count=3, items=[], more=None)")
    assert hash(Base("a", items=())) == hash(Base("A", items=()))
    with pytest.raises(TypeError, match="unhashable type: 'list'"):
        hash(Base("a"))
    assert Plain(1) != Plain(1) and "value" not in repr(Plain(1))
    assert Own(1) == Own(2) and repr(Own(1)) == "own"


def test_cannot_be_changed(made):
    base = made[0]("a")
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'count'"):
        base.count = 4
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'count'"):
        del base.count


def test_the_standard_library_derives_frozen_classes_alone(made):
    @dataclasses.dataclass(frozen=True)
    class More(made[0]):
        more: int = 1

    assert More("a").more == 1
    with pytest.raises(TypeError, match="cannot inherit non-frozen dataclass from a frozen one"):
        dataclasses.dataclass(type("Less", (made[0],), {}))


@frozen.dataclass(frozen=True)
class Sent:
    value: int


def test_is_pickled():
    assert pickle.loads(pickle.dumps(Sent(2))) == Sent(2)


def test_other_dataclasses_are_the_standard_librarys():
    @frozen.dataclass
    class Changing:
        value: int = 1

    changing = Changing()
    changing.value = 2
    assert changing == Changing(2)
