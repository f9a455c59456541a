"""Programs of a folder of tools/: modules with `main`, listed by their docstrings, run by name.

The parameters of `main` are what a command line may give: its arguments, and after `*` its options. Their annotations
hold the type, the words to choose from or a function that converts the text, and the help.
"""

import argparse
import ast
import inspect
import os
import sys
from collections.abc import Callable, Container, Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from mpucal.session.beside import ONE_THREAD

Jobs = Annotated[int, "processes"]
PROCESSORS = os.cpu_count() or 1


def run(folder: str) -> None:
    """Run the program of `folder` that the command line names, or list them.

    Raises:
        SystemExit: by the program; with a sentence where there is none of that name.
    """
    # as mpucal does, before NumPy loads
    os.environ.update(ONE_THREAD)
    programs = {path.stem: path for path in sorted((Path(__file__).parent / folder).glob("*.py")) if _runs(path)}
    match sys.argv[1:]:
        case [name, *arguments] if name in programs:
            sys.argv = [f"python -m tools.{folder} {name}", *arguments]
            sys.exit(call(import_module(f"tools.{folder}.{name}"), arguments))
        case [name, *_] if not name.startswith("-"):
            sys.exit(f"tools.{folder} has no program {name!r}; `python -m tools.{folder}` lists them")
        case _:
            for name, path in programs.items():
                print(f"{name:18} {(ast.get_docstring(ast.parse(path.read_text())) or '').splitlines()[0]}")


def call(module: Any, words: Sequence[str]) -> Any:
    """Call `main` of a program with what the command line gives; return the exit code."""
    if not inspect.isfunction(module.main):
        return module.main(words)
    return module.main(**parsed(module.__doc__, words, module.main))


def parsed(
    doc: str | None, words: Sequence[str] | None, *functions: Callable[..., Any], without: Container[str] = ()
) -> dict[str, Any]:
    """Return the values of these functions' parameters by their names, `without` some."""
    parser, known = (
        argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter),
        set(),
    )
    for function in functions:
        hints = get_type_hints(function, include_extras=True)
        for parameter in inspect.signature(function).parameters.values():
            if parameter.name not in without and parameter.name not in known:
                known.add(parameter.name)
                _add(parser, parameter, hints[parameter.name])
    return vars(parser.parse_args(words))


def _add(parser: argparse.ArgumentParser, parameter: inspect.Parameter, hint: Any) -> None:
    hint, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if get_origin(hint) is UnionType:
        hint = next(each for each in get_args(hint) if each is not NoneType)
    if get_origin(hint) is Literal:
        notes.append(get_args(hint))
    kind = get_args(hint)[0] if get_origin(hint) is Sequence else hint
    needed = parameter.default is parameter.empty
    how: dict[str, Any] = {"type": kind, "default": None if needed else parameter.default}
    if get_origin(hint) is Sequence:
        how["nargs"] = "+" if needed or parameter.kind is parameter.KEYWORD_ONLY else "*"
    for note in notes:
        if isinstance(note, str):
            how["help"] = note
        elif callable(note):
            how["type"] = note
            how.pop("nargs", None)
        else:
            how["type"] = partial(_one_of, note)
    if hint is bool:
        how = {"action": "store_true", "help": how.get("help")}
    if parameter.kind is parameter.KEYWORD_ONLY:
        parser.add_argument(f"--{parameter.name.replace('_', '-')}", required=needed, **how)
    else:
        parser.add_argument(parameter.name, **how if needed else {"nargs": "?", **how})


def _one_of(known: Iterable[str], text: str) -> str:
    if text not in known:
        raise argparse.ArgumentTypeError(f"{text!r} is none of: {', '.join(known)}")
    return text


def _runs(path: Path) -> bool:
    return any(text in path.read_text(encoding="utf-8") for text in ("\ndef main(", "\nmain = "))
