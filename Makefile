# Everything sets itself up: a virtual environment in .venv, the packages, the FMUs.
.DEFAULT_GOAL := help
.PHONY: help demo fast test soak coverage exchange conformance wheel oldest audit sanitize bench peers zoo lint docs clean

OLDEST := $(or $(PYTHON),python3.11)
ifneq ($(PYTHON),)
# `make test PYTHON=python3.13`: each version has an environment of its own
VENV := .venv-$(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
else
VENV := .venv
PYTHON := $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
endif
BIN := $(VENV)/bin
NATIVE := $(shell find fmus/native -name '*.c' -o -name '*.h' -o -name '*.toml' -o -name '*.md') \
	$(wildcard fmus/packaging/description/*.py) fmus/packaging/build.py fmus/packaging/compiler.py
# Tests side by side: one more than there are cores, as many tests wait for processes of their own. At most four,
# since these processes use cores as well. `make test PARALLEL=` runs the tests one by one.
WORKERS = $(shell $(PYTHON) -c 'import os; print(min(4, (os.cpu_count() or 1) + 1))')
PARALLEL ?= --side-by-side $(WORKERS)
SETUP := pyproject.toml hatch_build.py
# pip says what it does: it takes minutes, and silence looks like a stall
INSTALL = $(BIN)/python -m pip install --disable-pip-version-check
# what pyproject.toml names at its lower bounds, what those need in turn at its newest; pip has no such way
INSTALL_LOWEST = $(INSTALL_UV) && $(BIN)/uv pip install --python $(BIN)/python --resolution lowest-direct --reinstall
INSTALL_UV = $(BIN)/python -m pip install --disable-pip-version-check 'uv>=0.8'

ANNOUNCE = @echo "Installing vibroimpact and what it needs into $(VENV); the first time this takes some minutes."

help: ## show this
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/demo.stamp $(VENV)/fmus.stamp ## run the demonstration campaign; leaves a dataset and a figure
	$(BIN)/vibroimpact demo

fast: $(VENV)/test.stamp $(VENV)/fmus.stamp ## run the quick tests of every room, in about a minute; says what it left out
	$(BIN)/python -m pytest -q --fast $(PARALLEL)

test: $(VENV)/test.stamp $(VENV)/fmus.stamp ## run all tests but benchmarks and long series; ends in an error where they became dearer
	$(BIN)/python -m pytest --ignore=tests/benchmarks -m "not benchmark and not long" $(PARALLEL) --budget $(COSTS) --doctest-modules tests .editable/vibroimpact

soak: $(VENV)/test.stamp $(VENV)/fmus.stamp ## run long series, then thousands of random cases of each kind; goes on where it ended; SEED= MINUTES= KINDS= CASES=
	$(BIN)/python -m pytest --ignore=tests/benchmarks -m long $(PARALLEL)
	PYTHONPATH=tests $(BIN)/python -m soak
	PYTHONPATH=tests $(BIN)/python -m mutants

sanitize: $(VENV)/test.stamp ## run the C tests under the address and undefined-behaviour sanitizers
	$(BIN)/python tests/native/run_sanitized.py

bench: $(VENV)/bench.stamp $(VENV)/fmus.stamp ## run the benchmarks; each leaves its figures and a sentence; ends in an error where one missed its goal
	@missed=0; for script in tests/benchmarks/bench_*.py; do $(BIN)/python "$$script" || missed=1; done; exit $$missed

peers: $(VENV)/peers.stamp $(VENV)/fmus.stamp ## measure other people's solvers beside ours; writes the end of docs/accuracy.md
	PYTHONPATH=tests:tests/benchmarks $(BIN)/python -m peers

coverage: $(VENV)/test.stamp $(VENV)/fmus.stamp ## ask 480 records whether the intervals of estimates hold the truth; goes on where it ended; SEED= RECORDS=
	PYTHONPATH=tests OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m interval_coverage

exchange: $(VENV)/exchange.stamp $(VENV)/fmus.stamp ## try the exports in every tool that is here, compile them for other machines
	PYTHONPATH=tests $(BIN)/python -m exchange
	$(BIN)/python -m pytest -q tests/unit/fmus/packaging/test_cross.py -rs

zoo: $(VENV)/test.stamp $(VENV)/fmus.stamp ## run every FMU and system of a folder beside FMPy, into docs/exchange.md; ZOO= the folder
	PYTHONPATH=tests $(BIN)/python -m zoo $(ZOO)

conformance: $(VENV)/test.stamp $(VENV)/fmus.stamp ## run NI's tests of its client on the virtual rig; NI_TESTS= a checkout of ni/nidaqmx-python
	PYTHONPATH=tests $(BIN)/python -m conformance $(NI_TESTS)

wheel: $(VENV)/exchange.stamp ## make a wheel with the libraries of all platforms, into dist
	VIBROIMPACT_RELEASE=1 $(BIN)/python -m hatchling build -t wheel -d dist

oldest: ## run all tests on Python 3.11 with the lowest versions that pyproject.toml allows
	@$(OLDEST) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || { echo "make oldest: expected Python 3.11, got $$($(OLDEST) --version 2>&1). Say where it is: make oldest PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(MAKE) test VENV=.venv-oldest INSTALL='$$(INSTALL_LOWEST)' PYTHON=$(OLDEST)

audit: $(VENV)/audit.stamp ## ask the database of advisories about what is installed and about the lowest versions allowed; needs the network
	$(BIN)/python tests/support/audit.py

lint: $(VENV)/lint.stamp ## check style, types, the directions of imports and the rules of prose
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy tests/benchmarks
	$(BIN)/lint-imports
	$(BIN)/python docs/site/prose.py

docs: $(VENV)/docs.stamp $(VENV)/fmus.stamp ## build the documentation site, its pictures and its tutorials, and look at its pages in Chromium; a warning is an error
	$(BIN)/python docs/site/gallery.py build/docs/gallery
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -c docs/site -d build/docs/doctrees . build/docs/html
	$(BIN)/python docs/site/look.py build/docs/html build/docs/pictures
	@echo "The site begins at build/docs/html/index.html."

clean: ## remove what make has made
	rm -rf .venv .venv-* .editable build fmus/built

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "make: needs Python 3.11 or newer, found none on PATH. Install it, or say where it is: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "make: expected Python 3.11 or newer, got $$($(PYTHON) --version 2>&1). Say where one is: make PYTHON=/path/to/python3" >&2; exit 1; }
	@echo "Making the virtual environment $(VENV)."
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); echo "make: $(PYTHON) could not make a virtual environment. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }

# one environment; each purpose adds what it needs, once
$(VENV)/demo.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e .
	@touch $@ $(VENV)/fmus.stamp

$(VENV)/test.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[test]'
	@touch $@ $(VENV)/demo.stamp $(VENV)/fmus.stamp

# the benchmarks compare with other people's packages too
$(VENV)/bench.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[test,bench]'
	@touch $@ $(VENV)/test.stamp $(VENV)/demo.stamp $(VENV)/fmus.stamp

# other people's solvers, which nothing else needs
$(VENV)/peers.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[test,peers]'
	@touch $@ $(VENV)/test.stamp $(VENV)/demo.stamp $(VENV)/fmus.stamp

# other tools, and the compiler for other machines
$(VENV)/exchange.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[test,cross]'
	@touch $@ $(VENV)/test.stamp $(VENV)/demo.stamp $(VENV)/fmus.stamp

$(VENV)/lint.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[lint]'
	@touch $@ $(VENV)/demo.stamp $(VENV)/fmus.stamp

# with all that an installation may have: an advisory on any of it counts
$(VENV)/audit.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[audit,test]'
	@touch $@ $(VENV)/test.stamp $(VENV)/demo.stamp $(VENV)/fmus.stamp

$(VENV)/docs.stamp: $(SETUP) | $(BIN)/python
	$(ANNOUNCE)
	$(INSTALL) -e '.[docs]'
	@touch $@ $(VENV)/demo.stamp $(VENV)/fmus.stamp

# the installation builds the FMUs; only an edit of the C makes them again
$(VENV)/fmus.stamp: $(NATIVE) | $(VENV)/demo.stamp
	$(BIN)/python -m vibroimpact.fmus.packaging.build
	@touch $@
