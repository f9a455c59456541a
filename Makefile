# Two commands are all that a newcomer types: `make session` and `make test`. Each sets up what it needs.
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
export PYTHON

.PHONY: session test lint bench firmware clean

session: $(READY)
	@$(BIN)/mpucal session --bus sim

test: lint
	$(BIN)/pytest --numprocesses auto --dist loadfile

lint: $(READY)
	$(BIN)/ruff check --quiet .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

bench: $(READY)
	@$(BIN)/python tools/bench.py

# what is compiled here is what a rebuild hangs on
$(READY): tools/set_up pyproject.toml CMakeLists.txt mpucal/calibration/parameters.py $(shell find mpucal -name '*.[ch]pp')
	@tools/set_up $(VENV)
	@touch $@

# needs avr-gcc and avr-libc; says how much flash and RAM the bridge takes
firmware:
	@$(MAKE) --no-print-directory -C tools/firmware

clean:
	rm -rf $(VENV) build
