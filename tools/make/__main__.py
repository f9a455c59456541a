"""`python -m tools.make PROGRAM ...` runs a program of this folder; without one it lists them."""

from tools.programs import run

run("make")
