"""What trials share: the command line, one process pool over their seeds, and a JSON file of what they found."""

from __future__ import annotations

import argparse
import fnmatch
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import track

from mpucal.session.threads import ONE_THREAD

Item = TypeVar("Item")
Result = TypeVar("Result")


def command_line(doc: str | None, seeds: str = "0:20") -> argparse.ArgumentParser:
    """A parser with --seeds, --jobs and --json, whose help is the module's docstring."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=seed_range, default=seed_range(seeds), metavar="A:B", help=f"[{seeds}]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was found to it")
    return parser


def seed_range(text: str) -> range:
    """The seeds from A to B - 1 of `A:B`; of `N` alone the first N."""
    first, _, last = text.rpartition(":")
    return range(int(first or 0), int(last))


def names_of(known: Iterable[str]) -> Callable[[str], list[str]]:
    """A type of argument: the known names that match patterns with `;` between them, in their order."""
    names = list(known)

    def chosen(patterns: str) -> list[str]:
        for pattern in patterns.split(";"):
            if not fnmatch.filter(names, pattern):
                raise argparse.ArgumentTypeError(f"nothing is called {pattern!r}; there are: {'; '.join(names)}")
        return [name for name in names if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns.split(";"))]

    return chosen


def in_parallel(
    trial: Callable[[Item], Result], items: Iterable[Item], jobs: int, what: str = "trials"
) -> Iterator[Result]:
    """trial(item) of every item, in order, in `jobs` processes, with a progress bar on stderr."""
    # one thread a process: the arrays are small, and BLAS threads would only fight for the cores
    os.environ.update({name: value for name, value in ONE_THREAD.items() if name not in os.environ})
    waiting = list(items)
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        results = pool.imap(trial, waiting)
        yield from track(results, what, len(waiting), console=Console(stderr=True), transient=True)


def save(path: Path | None, document: Any) -> None:
    """Write dataclasses, and lists and dicts of them, as JSON; a figure that nobody knows is null. None: do nothing."""
    if path is not None:
        path.write_text(json.dumps(_plain(document), indent=1).replace("NaN", "null") + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(one) for one in value]
    return value
