"""`python -m tools.bench PROGRAM ...` runs a program of this folder; without one it lists them."""

import os

from mpucal.session.beside import ONE_THREAD
from tools.programs import run

# as in mpucal's commands, before NumPy is loaded
os.environ.update(ONE_THREAD)
run("bench")
