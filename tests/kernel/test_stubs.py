"""Stubs of the compiled modules, compared with the modules by mypy's stubtest."""

import re
from importlib import import_module
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
STUBS = sorted(path.relative_to(PROJECT) for path in (PROJECT / "mpucal").rglob("*.pyi"))
NAMES = [".".join(path.with_suffix("").parts) for path in STUBS]
# nanobind writes a default as its index in a list, and describes an array in a way that Python cannot parse.
DEFAULT, DETAILS = re.compile(r"\\(\d+)"), re.compile(r"ndarray\[[^\]]*\]")


def plain(function):
    """Return a Python function with the signature of nanobind's, which stubtest would take for an object."""
    ((signature, _, defaults),) = function.__nb_signature__
    text = DEFAULT.sub(lambda place: repr(defaults[int(place[1])]), DETAILS.sub("object", signature))
    made = {}
    exec(f"from __future__ import annotations\n{text}: ...", made)
    return made[function.__name__]


# Names, order and defaults of parameters do not depend on the type of an array, which takes mypy seconds to read.
CONFIG = "[mypy]\nfollow_imports = skip\nfollow_imports_for_stubs = True\n"


def test_the_stubs_are_those_of_the_modules(monkeypatch, capsys, tmp_path):
    stubtest = pytest.importorskip("mypy.stubtest")
    monkeypatch.chdir(PROJECT)  # stubtest looks for the stubs in the working directory
    for module in map(import_module, NAMES):
        compiled = {name: value for name, value in vars(module).items() if hasattr(value, "__nb_signature__")}
        assert compiled
        for name, value in compiled.items():
            monkeypatch.setattr(module, name, plain(value))
    (tmp_path / "mypy.ini").write_text(CONFIG)
    options = stubtest.parse_options([*NAMES, "--mypy-config-file", str(tmp_path / "mypy.ini")])
    assert stubtest.test_stubs(options) == 0, capsys.readouterr().out
