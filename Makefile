# Everything sets itself up: a virtual environment in .venv, the packages, the FMUs.
.DEFAULT_GOAL := help
.PHONY: help demo test sanitize bench lint clean

VENV := .venv
BIN := $(VENV)/bin
# override with `make PYTHON=...`; otherwise the first of these that is new enough
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
NATIVE := $(shell find fmus/native -name '*.c' -o -name '*.h' -o -name '*.toml' -o -name '*.md') \
	$(wildcard fmus/description/*.py) fmus/build.py fmus/compiler.py
# tests side by side, four at most, as many start processes of their own; `make test PARALLEL=` runs them one by one
PARALLEL ?= -n logical --maxprocesses 4 --dist worksteal
SETUP := pyproject.toml hatch_build.py

help: ## show this
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/demo.stamp $(VENV)/fmus.stamp ## run the demonstration campaign; leaves a dataset and a figure
	$(BIN)/vibroimpact demo

test: $(VENV)/test.stamp $(VENV)/fmus.stamp sanitize ## run all tests but the benchmarks
	$(BIN)/python -m pytest --ignore=tests/benchmarks -m "not benchmark" $(PARALLEL)
	$(BIN)/python -m pytest --doctest-modules --pyargs vibroimpact.fmus vibroimpact.analysis vibroimpact.orchestrator \
		vibroimpact.hardware

sanitize: $(VENV)/test.stamp ## run the C tests under the address and undefined-behaviour sanitizers
	$(BIN)/python tests/native/run_sanitized.py

bench: $(VENV)/bench.stamp $(VENV)/fmus.stamp ## run the benchmarks; each leaves its figures and a sentence
	@for script in tests/benchmarks/bench_*.py; do $(BIN)/python "$$script" || exit 1; done

lint: $(VENV)/lint.stamp ## check style, types and the directions of imports
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean: ## remove what make has made
	rm -rf $(VENV) .editable fmus/built

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "make: needs Python 3.11 or newer, found none on PATH. Install it, or say where it is: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "make: expected Python 3.11 or newer, got $$($(PYTHON) --version 2>&1). Say where one is: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); echo "make: $(PYTHON) could not make a virtual environment. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }

# one environment; each purpose adds what it needs, once
$(VENV)/demo.stamp: $(SETUP) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@ $(VENV)/fmus.stamp

$(VENV)/test.stamp: $(SETUP) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test]'
	@touch $@ $(VENV)/demo.stamp $(VENV)/fmus.stamp

# the benchmarks compare with other people's packages too
$(VENV)/bench.stamp: $(SETUP) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,bench]'
	@touch $@ $(VENV)/test.stamp $(VENV)/demo.stamp $(VENV)/fmus.stamp

$(VENV)/lint.stamp: $(SETUP) | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[lint]'
	@touch $@ $(VENV)/demo.stamp $(VENV)/fmus.stamp

# the installation builds the FMUs; only an edit of the C makes them again
$(VENV)/fmus.stamp: $(NATIVE) | $(VENV)/demo.stamp
	$(BIN)/python -m vibroimpact.fmus.build
	@touch $@
