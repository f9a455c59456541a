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
from .session.threads import ONE_THREAD
from .terminal.hangup import logging_after_hangup

BUG = 1
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
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        # CPython would end by SIGINT if the interrupt came inside exec, as in a dataclass; another exec prevents that
        exec("")
        words = _words(arguments)
        kept = "; the recording until then is kept" if words and words[0] in RECORDING else ""
        if EVENTS in words:
            return _event(Abandoned.exit_code, f"interrupted{kept}", "")
        print(f"mpucal: interrupted{kept}.", file=sys.stderr)
        return Abandoned.exit_code
    except OSError as error:
        if error.errno not in DENIED:
            return _bug(arguments)
        if error.errno in NO_ROOM and error.filename is None:
            # flushing at exit would fail again
            sys.stdout = None
            print(f"mpucal: the output cannot be written ({error.strerror}): free space there.", file=sys.stderr)
            return OutputError.exit_code
        what = error.filename or "a file or device"
        return _report(arguments, f"cannot use {what} ({error.strerror})", "check its permissions, and the disk")
    except MemoryError:
        return _report(arguments, "there is not enough memory", "end other programs, or give a shorter recording")


def _run(arguments: Sequence[str] | None) -> int:
    import click  # noqa: PLC0415

    from .cli import amended, commands  # noqa: PLC0415

    try:
        return int(commands.main(args=arguments, prog_name="mpucal", standalone_mode=False) or 0)
    except click.ClickException as error:
        if EVENTS not in _words(arguments):
            error.show()
            return error.exit_code
        return _event(error.exit_code, error.format_message(), f"see `mpucal {_words(arguments)[0]} --help`")
    except click.Abort:
        raise KeyboardInterrupt from None
    except MpucalError as error:
        if EVENTS in _words(arguments):
            return _event(error.exit_code, error.what, error.remedy)
        click.echo(f"mpucal: {error}", err=True)
        if error.options or error.without:
            # the whole command, to be copied
            again = amended(_words(arguments), error.options, error.without)
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
        return _bug(arguments)


def _words(arguments: Sequence[str] | None) -> Sequence[str]:
    return sys.argv[1:] if arguments is None else arguments


def _report(arguments: Sequence[str] | None, what: str, do: str) -> int:
    """Report a missing resource of the computer as a sentence or event; return the exit code."""
    if EVENTS in _words(arguments):
        return _event(SourceError.exit_code, what, do)
    print(f"mpucal: {what}: {do}.", file=sys.stderr)
    return SourceError.exit_code


def _event(exit_code: int, what: str, remedy: str) -> int:
    """Print an error as an event; return its exit code."""
    import json  # noqa: PLC0415

    event = {"event": "error", "exit_code": exit_code, "what": what, "remedy": remedy}
    print(json.dumps(event), file=sys.stderr)
    return exit_code


def _bug(arguments: Sequence[str] | None) -> int:
    import traceback  # noqa: PLC0415

    traceback.print_exc()
    if EVENTS in _words(arguments):
        return _event(BUG, "this is a bug in mpucal", "please report it with the lines above")
    print("mpucal: this is a bug in mpucal: please report it with the lines above.", file=sys.stderr)
    return BUG


if __name__ == "__main__":
    main()
