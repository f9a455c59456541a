# Two commands do all the set-up: `make session` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: session test lint bench clean

session: $(READY)
	$(BIN)/mpucal session --bus sim

test: lint
	$(BIN)/pytest

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python tools/bench.py

# the kernel is compiled here, so its sources are what a rebuild hangs on
$(READY): pyproject.toml CMakeLists.txt $(wildcard mpucal/kernel/*.cpp mpucal/kernel/*.hpp)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[plot,dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist
