"""`python -m mpucal` and the `mpucal` command: an exit code for each class of error, and one sentence."""

from __future__ import annotations

# next to nothing here: what takes a while to load does so where Ctrl-C finds its sentence
import errno
import gc
import io
import os
import shlex
import sys
from collections.abc import Sequence
from typing import Any

from .errors import Abandoned, MpucalError, OutputError, SourceError, plain
from .session.threads import ONE_THREAD

BUG = 1
# of a full disk or quota behind stdout
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# what the loader says of a library that memory does not hold
UNMAPPED = "failed to map segment"
# what a computer may answer to whatever is asked of it
DENIED = (*NO_ROOM, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
# the commands whose capture is written as it happens
RECORDING = ("session", "record")
# errors are events then, too
EVENTS = "--json-events"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command, and leave with its exit code."""
    for variable, one in ONE_THREAD.items():
        os.environ.setdefault(variable, one)
    _keep_streams()
    code = run(arguments)
    # Python looks through everything for cycles at its end, which takes longer than some commands
    gc.freeze()
    sys.exit(code)


def _keep_streams() -> None:
    """Streams that take every text; whatever becomes of stderr, what was measured is worth more than what is said."""
    for handle in (0, 1, 2):
        try:
            os.fstat(handle)
        except OSError:
            # a file that is opened later would take its place, and receive what is said
            os.open(os.devnull, os.O_RDWR)
    if isinstance(sys.stdout, io.TextIOWrapper):
        encoding, to_a_person = sys.stdout.encoding, sys.stdout.line_buffering
        sys.stdout = _Plain(sys.stdout.detach(), encoding, "backslashreplace", line_buffering=to_a_person)
    if sys.stderr is None or not sys.stderr.isatty():
        raw = io.BufferedWriter(_Unfailing(2, "wb", closefd=False))
        sys.stderr = _Plain(raw, "utf-8", "backslashreplace", line_buffering=True)


class _Plain(io.TextIOWrapper):
    """Text that a terminal only shows: what it would obey, as in the name of a file, is escaped."""

    def write(self, text: str) -> int:
        return super().write(plain(text))


class _Unfailing(io.FileIO):
    """What cannot be written is left out."""

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
        # where it came while text was executed, as for a dataclass, CPython ends by SIGINT, unless text was since
        exec("")
        words = _words(arguments)
        kept = "; what was recorded until then is kept" if words and words[0] in RECORDING else ""
        if EVENTS in words:
            return _event(Abandoned.exit_code, f"interrupted{kept}", "")
        print(f"mpucal: interrupted{kept}.", file=sys.stderr)
        return Abandoned.exit_code
    except OSError as error:
        if error.errno not in DENIED:
            return _bug(arguments)
        if error.errno in NO_ROOM and error.filename is None:
            # Python would complain again while it flushes
            sys.stdout = None
            print(f"mpucal: the output cannot be written ({error.strerror}): make room where it goes.", file=sys.stderr)
            return OutputError.exit_code
        what = error.filename or "a file or device"
        return _denied(arguments, f"cannot use {what} ({error.strerror})", "check its permissions, and the disk")
    except MemoryError:
        return _denied(arguments, "there is not enough memory", "end other programs, or give a shorter recording")


def _run(arguments: Sequence[str] | None) -> int:
    import click  # noqa: PLC0415

    from .cli import commands  # noqa: PLC0415

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
        if error.options:
            # the whole of it, to be copied
            click.echo(f"mpucal: try `mpucal {shlex.join(_words(arguments))} {error.options}`", err=True)
        return error.exit_code
    except SystemExit:
        # click's own end where who read the results has left: that is no error
        return 0
    except (OSError, MemoryError):
        # as while modules are loaded
        raise
    except Exception as error:
        if isinstance(error, ImportError) and UNMAPPED in str(error):
            raise MemoryError from error
        return _bug(arguments)


def _words(arguments: Sequence[str] | None) -> Sequence[str]:
    return sys.argv[1:] if arguments is None else arguments


def _denied(arguments: Sequence[str] | None, what: str, do: str) -> int:
    """What the computer cannot give, in a sentence or event."""
    if EVENTS in _words(arguments):
        return _event(SourceError.exit_code, what, do)
    print(f"mpucal: {what}: {do}.", file=sys.stderr)
    return SourceError.exit_code


def _event(exit_code: int, what: str, remedy: str) -> int:
    """An error as one more event; its exit code."""
    import json  # noqa: PLC0415

    said = {"event": "error", "exit_code": exit_code, "what": what, "remedy": remedy}
    print(json.dumps(said), file=sys.stderr)
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
