"""Runs command lines of mpucal, one after the other, with the row of another program of this folder in its table.

    served.py PROGRAM

Each line of stdin is a folder to run in and the words, as JSON; each line of stdout the exit code, and what was printed
to stdout and stderr.
"""

import importlib
import json
import os
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

from mpucal.__main__ import run

if __name__ == "__main__":
    importlib.import_module(sys.argv[1]).add()
    for line in sys.stdin:
        folder, *words = json.loads(line)
        os.chdir(folder)
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            code = run(words)
        print(json.dumps([code, out.getvalue(), err.getvalue()]), flush=True)
