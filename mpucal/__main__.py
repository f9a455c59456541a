"""`python -m mpucal` and the `mpucal` command: each error becomes one sentence and an exit code."""

from __future__ import annotations

# few imports: slow ones happen inside run(), which handles Ctrl-C
import errno
import gc
import io
import os
import shlex
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .errors import Abandoned, MpucalError, OutputError, SourceError, escape_controls
from .session.beside import ONE_THREAD
from .terminal.hangup import logging_after_hangup

# errors of a full disk or quota behind stdout
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# the loader's message about a library that does not fit into memory
UNMAPPED = "failed to map segment"
# errors that any access to a file or device may cause
DENIED = (*NO_ROOM, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
# commands that write a capture while they run
RECORDING = ("session", "record")
# with this option errors are JSON events
EVENTS = "--json-events"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command, and exit with its exit code."""
    for variable, one in ONE_THREAD.items():
        os.environ.setdefault(variable, one)
    _keep_streams()
    # nearly every object lives as long as the program or ends with its last reference: few cycles, looked for seldom,
    # and what a module made is not looked at again
    gc.set_threshold(50_000, 1_000)
    # SIGTERM and SIGHUP end a command as Ctrl-C does
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    with logging_after_hangup(lambda: Path(os.devnull), lambda: signal.default_int_handler(signal.SIGHUP, None)):
        code = run(arguments)
    # without the last garbage collection, which takes longer than some commands
    gc.freeze()
    sys.exit(code)


def _keep_streams() -> None:
    """Replace stdout and stderr by streams that accept every text; a failing stderr must not end a measurement."""
    for handle in (0, 1, 2):
        try:
            os.fstat(handle)
        except OSError:
            # otherwise the next opened file would get this number, and receive the messages
            os.open(os.devnull, os.O_RDWR)
    if isinstance(sys.stdout, io.TextIOWrapper):
        encoding, to_a_person = sys.stdout.encoding, sys.stdout.line_buffering
        sys.stdout = _Plain(sys.stdout.detach(), encoding, "backslashreplace", line_buffering=to_a_person)
    if sys.stderr is None or not sys.stderr.isatty():
        raw = io.BufferedWriter(_Unfailing(2, "wb", closefd=False))
        sys.stderr = _Plain(raw, "utf-8", "backslashreplace", line_buffering=True)


class _Plain(io.TextIOWrapper):
    """Text stream that escapes control characters, such as those in a file's name."""

    def write(self, text: str) -> int:
        return super().write(escape_controls(text))


class _Unfailing(io.FileIO):
    """Raw stream that ignores errors of writing."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        return _run(words)
    except KeyboardInterrupt:
        # CPython would end by SIGINT if the interrupt came inside exec, as in a dataclass; another exec prevents that
        exec("")
        kept = "; the recording until then is kept" if words and words[0] in RECORDING else ""
        return _report(words, Abandoned.exit_code, f"interrupted{kept}")
    except OSError as error:
        if error.errno not in DENIED:
            return _report_bug(words)
        if error.errno in NO_ROOM and error.filename is None:
            # flushing at exit would fail again
            sys.stdout = None
            print(f"mpucal: the output cannot be written ({error.strerror}): free space there.", file=sys.stderr)
            return OutputError.exit_code
        what = f"cannot use {error.filename or 'a file or device'} ({error.strerror})"
        return _report(words, SourceError.exit_code, what, "check its permissions, and the disk")
    except MemoryError:
        remedy = "end other programs, or give a shorter recording"
        return _report(words, SourceError.exit_code, "there is not enough memory", remedy)


def _run(words: Sequence[str]) -> int:
    import click  # noqa: PLC0415

    from .cli import amended, commands  # noqa: PLC0415

    try:
        return int(commands.main(args=words, prog_name="mpucal", standalone_mode=False) or 0)
    except click.ClickException as error:
        if EVENTS in words:
            return _report(words, error.exit_code, error.format_message(), f"see `mpucal {words[0]} --help`")
        error.show()
        return error.exit_code
    except click.Abort:
        raise KeyboardInterrupt from None
    except MpucalError as error:
        if EVENTS in words:
            return _report(words, error.exit_code, error.what, error.remedy)
        click.echo(f"mpucal: {error}", err=True)
        if error.options or error.without:
            # the whole command, to be copied
            again = amended(words, error.options, error.without)
            click.echo(f"mpucal: try `mpucal {shlex.join(again)}`", err=True)
        return error.exit_code
    except SystemExit:
        # click exits so if the reader of stdout has gone, which is not an error
        return 0
    except (OSError, MemoryError):
        # also from the loading of modules
        raise
    except Exception as error:
        if isinstance(error, ImportError) and UNMAPPED in str(error):
            raise MemoryError from error
        return _report_bug(words)


def _report(words: Sequence[str], exit_code: int, what: str, remedy: str = "") -> int:
    """Print an error as a sentence, or as an event if the command line asks for events; return its exit code."""
    if EVENTS in words:
        import json  # noqa: PLC0415

        print(json.dumps({"event": "error", "exit_code": exit_code, "what": what, "remedy": remedy}), file=sys.stderr)
    else:
        print(f"mpucal: {what}{': ' if remedy else ''}{remedy}.", file=sys.stderr)
    return exit_code


def _report_bug(words: Sequence[str]) -> int:
    import traceback  # noqa: PLC0415

    traceback.print_exc()
    return _report(words, MpucalError.exit_code, "this is a bug in mpucal", "please report it with the lines above")


if __name__ == "__main__":
    main()
