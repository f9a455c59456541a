"""Runner of trial programs: options, a pool of processes for the items, the report, and a JSON file of the rows."""

from __future__ import annotations

import argparse
import fnmatch
import inspect
import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

Asked = argparse.Namespace
Option = tuple[tuple[str, ...], dict[str, Any]]


def option(*names: str, **how: Any) -> Option:
    """Declare an option or argument, as argparse takes it."""
    return names, how


@dataclass(frozen=True)
class Program:
    """A program of trials, as a module's `main`; `python -m tools.lab NAME --help` prints `doc`.

    Attributes
    ----------
    run : tries one item and returns a row, several, or None; it gets those options that it has parameters of.
    items : what there is to try, by the options. report : prints what was found and returns the exit code.
    seeds : the seeds without --seeds. line : the text of a row that is printed as it comes.
    """

    doc: str | None
    run: Callable[..., Any]
    items: Callable[[Asked], Iterable[Any]]
    report: Callable[[list[Any], Asked], int | None]
    options: tuple[Option, ...] = ()
    seeds: str | None = "0:20"
    line: Callable[[Any], str] | None = None

    def __call__(self, words: Sequence[str] | None = None) -> int:
        """Try all items of the command line, print the report, and return the exit code."""
        asked = self._parser().parse_args(words)
        passed = {name: vars(asked)[name] for name in inspect.signature(self.run).parameters if name in vars(asked)}
        rows: list[Any] = []
        for told in in_parallel(partial(self.run, **passed), self.items(asked), asked.jobs):
            several = told if isinstance(told, list) else [] if told is None else [told]
            rows += several
            for row in several if self.line else ():
                print(self.line(row), flush=True)
        code = self.report(rows, asked)
        if asked.json:
            # an unknown figure is null
            text = json.dumps([asdict(row) if is_dataclass(row) else row for row in rows], indent=1)
            asked.json.write_text(text.replace("NaN", "null") + "\n", encoding="utf-8")
        return code or 0

    def _parser(self) -> argparse.ArgumentParser:
        parser = argparse.ArgumentParser(description=self.doc, formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument("--seeds", type=seed_range, default=self.seeds, metavar="A:B", help="or a count")
        parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
        parser.add_argument("--json", type=Path, metavar="FILE", help="write what was found to it")
        for names, how in self.options:
            parser.add_argument(*names, **how)
        return parser


def seed_range(text: str) -> range:
    """Return the seeds from A to B - 1 of `A:B`, the first N of `N`."""
    first, _, last = text.rpartition(":")
    return range(int(first or 0), int(last))


def names_of(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Return a type of argument: the known names that match patterns with `;` between them, in their order."""
    names = list(known)

    def chosen(patterns: str) -> list[str]:
        for pattern in patterns.split(";"):
            if not fnmatch.filter(names, pattern):
                raise argparse.ArgumentTypeError(f"nothing is called {pattern!r}; there are: {'; '.join(names)}")
        return [name for name in names if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns.split(";"))]

    return chosen


def in_parallel(run: Callable[[Any], Any], items: Iterable[Any], jobs: int) -> Iterator[Any]:
    """Yield run(item) of every item, in order, from so many processes, with a progress bar on stderr."""
    waiting = list(items)
    if jobs == 1:
        yield from map(run, waiting)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        results = pool.imap(run, waiting)
        yield from track(results, "trials", len(waiting), console=Console(stderr=True), transient=True)
