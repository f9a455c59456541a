"""`python -m tools.bench PROGRAM ...` runs a program of this folder; without one it lists them."""

from tools.programs import run

run("bench")
