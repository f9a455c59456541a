# Two commands are all that a newcomer types: `make session` and `make test`. Each sets up what it needs.
VENV := .venv
BIN := $(VENV)/bin
# what runs mpucal, and what tests it
READY := $(VENV)/.ready
TESTED := $(VENV)/.tested
export PYTHON
# without its bytecode each start of mpucal compiles 230 modules
unexport PYTHONDONTWRITEBYTECODE

SECONDS ?= 600

.PHONY: session test tests slow search campaign fuzz kernel lint audit bench wheel docs firmware clean

session: $(READY)
	@$(BIN)/mpucal session --bus sim

# linters, types and tests side by side; the tests build the site of the documentation, too
test: $(TESTED)
	@$(MAKE) --no-print-directory -j2 lint tests

tests: $(TESTED)
	@$(BIN)/pytest --numprocesses auto --dist worksteal

# what `make test` leaves out for its time
slow: $(TESTED)
	$(BIN)/pytest --numprocesses auto -m slow

# the property tests with examples that are drawn by SEED
SEED := $(or $(SEED),$(shell date +%s))
search: $(TESTED)
	@echo "search: make search SEED=$(SEED) draws the same examples again"
	@HYPOTHESIS_PROFILE=search $(BIN)/pytest --numprocesses auto --dist worksteal -m "hypothesis and not kernel and not slow" \
		--hypothesis-seed=$(SEED)

# struck sessions and recordings, with seeds that change by the day and are printed
campaign: $(TESTED)
	@$(BIN)/python -m tools.lab campaign --sessions 200 --recordings 2000

# the search above; then readers, peers, compiled modules and the firmware's core on hostile input, for SECONDS and a
# quarter as much again
fuzz: search
	@$(BIN)/pip install --quiet --disable-pip-version-check atheris
	@$(BIN)/python -W ignore -m tools.attack fuzz --guided --budget $(SECONDS)
	@$(BIN)/python -m tools.attack fuzz_kernel --seconds $$(($(SECONDS) / 8))
	@if command -v clang >/dev/null; then $(BIN)/python -m tools.attack fuzz_core --seconds $$(($(SECONDS) / 8)); fi

lint: $(TESTED)
	$(BIN)/ruff check --quiet .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/python -m pytest -q tests/test_docstrings.py

# what is locked, against the known vulnerabilities; needs the network, and says which packages it could not look up
audit:
	@python3 -m venv build/audit
	@build/audit/bin/pip install --quiet pip-audit
	@build/audit/bin/pip-audit --disable-pip --require-hashes --requirement tools/lock.txt

bench: $(READY)
	@$(BIN)/python -m tools.bench speed

# sdist and wheel, tried in environments of their own
wheel:
	@tools/try_wheel dist

# the documentation site, in build/site; a warning is an error
docs: $(TESTED)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

# what is compiled here is what a rebuild hangs on
BUILT_OF := tools/set_up pyproject.toml CMakeLists.txt mpucal/calibration/parameters.py $(shell find mpucal -name '*.[ch]pp')

$(READY): $(BUILT_OF)
	@tools/set_up $(VENV) mavlink
	@touch $@

$(TESTED): $(BUILT_OF)
	@tools/set_up $(VENV) mavlink,plot,dev
	@touch $(READY) $@

# a Debian kernel in QEMU, over the host's files: its own I2C and IIO drivers; needs root to see all of these
KERNEL := build/kernel
kernel: $(TESTED)
	@mkdir -p $(KERNEL)
	@ls $(KERNEL)/linux-kbuild-*.deb >/dev/null 2>&1 || [ -n "$$MPUCAL_KERNEL" ] || (cd $(KERNEL) && \
		image=$$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: //p') && headers=linux-headers-$${image#*-*-} && \
		apt-get -qq -o APT::Sandbox::User=root download $$image $$headers \
			$$(apt-cache depends $$headers | sed -n 's/.*Depends: \(linux-[hk]\)/\1/p')) || \
		echo "kernel: could not fetch Debian's linux-image and linux-headers"
	@$(BIN)/pytest -m kernel -rs --numprocesses 2 --dist loadfile tests/linux

# needs avr-gcc and avr-libc; says how much flash and RAM the bridge takes
firmware:
	@$(MAKE) --no-print-directory -C mpucal/firmware

clean:
	rm -rf $(VENV) build
