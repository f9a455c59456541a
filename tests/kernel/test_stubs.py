"""The stubs of the compiled modules, compared with the signatures that nanobind's functions carry.

mypy's stubtest takes nanobind's functions for objects, and checks nothing of them.
"""

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

import mpucal

# nanobind writes a default as its place in a list, and of an array what Python cannot read
DEFAULT, DETAILS = re.compile(r"\\\d+"), re.compile(r"ndarray\[[^\]]*\]")


def arguments(function):
    """(name, whether it may be left out, whether it may be None) of each argument of an ast.FunctionDef."""
    required = len(function.args.args) - len(function.args.defaults)
    return [
        (each.arg, i >= required, ast.unparse(each.annotation).endswith("| None"))
        for i, each in enumerate(function.args.args)
    ]


@pytest.mark.parametrize("name", ["mpucal.kernel._kernel", "mpucal.files._text"])
def test_the_stub_is_that_of_the_module(name):
    stub = ast.parse((Path(mpucal.__file__).parents[1] / f"{name.replace('.', '/')}.pyi").read_text())
    stubbed = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
    module = vars(import_module(name))
    made = {key: value.__nb_signature__ for key, value in module.items() if hasattr(value, "__nb_signature__")}
    assert made and made.keys() == stubbed.keys()
    for key, ((text, *_),) in made.items():
        (function,) = ast.parse(DETAILS.sub("ndarray", DEFAULT.sub("None", text)) + ": ...").body
        assert arguments(stubbed[key]) == arguments(function), key
