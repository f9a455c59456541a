"""Table of sources, and its uses."""

from pkgutil import resolve_name

import pytest

from mpucal.errors import UsageError
from mpucal.origin import Origin
from mpucal.sources.opening import check_source
from mpucal.sources.table import ADDRESS, SOURCES, kinds_for

IDS = [kind.flag for kind in SOURCES]


@pytest.mark.parametrize("kind", SOURCES, ids=IDS)
def test_all_that_a_row_names_is_there(kind):
    for place in filter(None, (kind.opener, kind.store, kind.doctor, kind.host, kind.found)):
        assert callable(resolve_name(place))


@pytest.mark.parametrize("command", ["session", "record", "stream", "write", "show", "doctor"])
def test_a_command_takes_what_its_help_names_and_refuses_the_rest(command):
    for kind in SOURCES:
        values = {kind.option.name: kind.word or "x"}
        if kind in kinds_for(command):
            assert check_source(values, {}, command) is kind
        else:
            with pytest.raises(UsageError, match=f"{kind.flag} was given, and `mpucal {command}` does not take it"):
                check_source(values, {}, command)


def test_each_option_is_refused_with_sources_that_do_not_have_it():
    every = {option for kind in SOURCES for option in (*kind.options, *kind.settings)}
    refused = 0
    for kind in SOURCES:
        if kind.origin is Origin.FILE:
            continue
        for option in every - {*kind.options, *kind.settings}:
            refused += 1
            with pytest.raises(UsageError, match=f"{kind.flag} does not take {option.flag}"):
                check_source({kind.option.name: kind.word or "x"}, {option.name: option.flag}, "session")
    assert refused


def test_options_refuse_meaningless_text():
    options = {option.name: option for kind in SOURCES for option in (kind.option, *kind.options, *kind.settings)}
    assert options["bus"].parse("1") == "/dev/i2c-1"
    assert options["address"].parse("0x69") == 0x69
    for name, text in {"bus": "", "address": "0x80", "seed": "-1", "system": "0", "dlpf": "7", "rate": "fast"}.items():
        with pytest.raises(ValueError, match=r"\.$"):
            options[name].parse(text)


@pytest.mark.parametrize(("text", "limits"), [("0x03", "0x08 to 0x77"), ("120", "8 to 119")])
def test_a_reserved_address_is_refused_in_the_base_that_was_typed(text, limits):
    with pytest.raises(ValueError, match=f"{text} is not {limits}"):
        ADDRESS.parse(text)
