# setup, demo and test need Python 3.11 or later, make and the package registries, nothing else.
PYTHON ?= python3
BIN := .venv/bin
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: setup demo test coverage studies bench faults kills lint clean
setup: .venv/installed

.venv/installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "droptower needs Python 3.11 or later, this is $$($(PYTHON) --version); name another by: make PYTHON=python3.12" >&2; exit 1; }
	@echo "setting up .venv (some 900 MB, a minute or two)"
	$(PYTHON) -m venv .venv
	$(INSTALL) --editable .
	$(BIN)/python -m analysis.fit_problem  # compiles the kernel of the fits, so that no first drop waits for it
	@touch $@

.venv/installed-dev: .venv/installed
	$(INSTALL) --editable '.[dev]'
	@touch $@

demo: setup
	$(BIN)/droptower demo

test: .venv/installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest --numprocesses 2 --dist loadscope

# How often the 95 % intervals of events and of fits hold the truth; docs/method.md and docs/fits.md quote them.
coverage: .venv/installed-dev
	$(BIN)/python bench/coverage_events.py
	$(BIN)/python bench/coverage_fits.py

# Failures, cracks and slips found and not; v0_fail and the threshold of thickness; docs/series.md quotes them. An hour.
STUDIES ?= 2000
studies: .venv/installed-dev
	OPENBLAS_NUM_THREADS=1 $(BIN)/python bench/failure.py --drops $(STUDIES)
	$(BIN)/python bench/series.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python bench/thickness.py

# Readout and storage against bare loops on the same wires and disk, fits against peers; ten minutes, most of it at 115,200 baud.
bench: .venv/installed-dev
	$(BIN)/python bench/wires.py
	$(BIN)/python bench/durable.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python bench/fits.py

# Every fault on every wire, a quarter of an hour; the table goes into the manual. CI plays a seeded draw.
FAULTS ?= --write docs/faults.md
faults: .venv/installed-dev
	$(BIN)/python bench/faults.py $(FAULTS)

# The host killed a thousand times, and then the emulator, at every step of a drop; an hour. CI runs 40.
KILLS ?= 1000
kills: .venv/installed-dev
	$(BIN)/python bench/kills.py --of host --kills $(KILLS)
	$(BIN)/python bench/kills.py --of emulator --kills $(KILLS) --at-once 4

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

clean:
	rm -rf .venv build *.egg-info
