"""Runner of trials: options, a pool of processes for the scenarios, the table, and a JSON file of the rows."""

import argparse
import fnmatch
import inspect
import json
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.progress import track

from tools.programs import PROCESSORS, Jobs, parsed

from .table import Column, Row, grouped, show, table


@dataclass(frozen=True)
class Trial:
    """A trial, as a module's `main`; `python -m tools.lab NAME --help` prints `doc`.

    The parameters of the functions, besides what they are about, are its options, as tools/programs.py makes them.

    Attributes
    ----------
    judge : tries one scenario and returns a row, several, or None. scenarios : by the seeds and other options.
    columns : of the table, with a line for each value of the attributes `by`; title : of the table, by the options.
    report : prints more of the rows, and returns the exit code; otherwise that is 1 if a row has something `wrong`.
    seeds : without --seeds. line : text of a row that is printed as it comes; without it, what is `wrong`, if anything.
    """

    doc: str | None
    judge: Callable[..., Row | list[Row] | None]
    scenarios: Callable[..., Iterable[Any]]
    columns: Mapping[str, Column] | None = None
    by: tuple[str, ...] = ("name",)
    title: str = ""
    report: Callable[..., int | None] | None = None
    seeds: str = "0:20"
    line: Callable[[Row], str] | None = None

    def __call__(self, words: Sequence[str] | None = None) -> int:
        """Try all scenarios of the command line, print the table, and return the exit code."""

        def options(
            *,
            seeds: Annotated[range, seed_range, "A:B, or a count"] = seed_range(self.seeds),
            jobs: Jobs = PROCESSORS,
            json: Annotated[Path | None, "file for the rows"] = None,
        ) -> None: ...

        functions: tuple[Callable[..., Any], ...] = (
            options,
            self.scenarios,
            self.judge,
            *([self.report] if self.report else []),
        )
        # what these are about is no option, and not every trial draws by seeds
        without = {next(iter(inspect.signature(each).parameters)) for each in functions[2:]}
        without |= set() if any("seeds" in inspect.signature(each).parameters for each in functions[1:]) else {"seeds"}
        given = parsed(self.doc, words, *functions, without=without)
        rows: list[Row] = []
        judge = partial(self.judge, **_taken(self.judge, given))
        for told in in_parallel(judge, self.scenarios(**_taken(self.scenarios, given)), given["jobs"]):
            several = told if isinstance(told, list) else [] if told is None else [told]
            rows += several
            for text in filter(None, map(self.line or self._wrong, several)):
                print(text, flush=True)
        if self.columns:
            show(table(grouped(rows, *self.by), self.columns, self.title.format(**given) or None))
        code = int(any(getattr(row, "wrong", None) for row in rows))
        if self.report:
            code = self.report(rows, **_taken(self.report, given)) or 0
        if given["json"]:
            # an unknown figure is null
            text = json.dumps([vars(row) for row in rows], indent=1)
            given["json"].write_text(text.replace("NaN", "null") + "\n", encoding="utf-8")
        return code

    def _wrong(self, row: Row) -> str:
        wrong = getattr(row, "wrong", None)
        told = "; ".join(wrong) if isinstance(wrong, list) else wrong
        return f"WRONG {', '.join(str(getattr(row, name)) for name in self.by)}: {told}" if wrong else ""


def _taken(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: given[name] for name in inspect.signature(function).parameters if name in given}


def each_seed(names: Iterable[Any], seeds: Iterable[int]) -> list[tuple[Any, int]]:
    """Return each name with each seed."""
    return list(product(names, seeds))


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
    # processes that may start others, as a batch does
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        results = pool.map(run, waiting)
        yield from track(results, "trials", len(waiting), console=Console(stderr=True), transient=True)
