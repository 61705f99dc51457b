# Everything a fresh machine needs is Python 3.11 or newer with venv, make and a C compiler: `make demo`, then `make test`.
PYTHON ?= python3
VENV   := .venv
PY     := $(VENV)/bin/python
PINS   := constraints.txt
PIP    := $(PY) -m pip --disable-pip-version-check --quiet install --constraint $(PINS)

PARALLEL := --numprocesses auto --dist loadfile  # a test file per core
QUICK    := XLA_FLAGS=--xla_backend_optimization_level=0  # most kernels run once: a third less time than optimised

# A stamp is written when its step is complete, so that an interrupted set-up starts again.
RUN   := $(VENV)/.stamp-run
TEST  := $(VENV)/.stamp-test
BENCH := $(VENV)/.stamp-bench
DOCS  := $(VENV)/.stamp-docs

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help setup demo test test-all bench docs pin clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1|\2/p' $(firstword $(MAKEFILE_LIST)) | awk -F'|' '{printf "%-15s %s\n", $$1, $$2}'

setup: $(RUN) ## make .venv with what the program needs, at the pinned versions

demo: $(RUN) ## Table I and Fig. 1 of the paper, into demo-out/
	$(VENV)/bin/locbounds paper fritsche2013 --out demo-out

test: $(TEST) ## format, types, layers and tests (what .ci/run calls)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m pyright
	$(QUICK) $(PY) -m pytest $(PARALLEL)

test-all: test ## the same, then the slow tests
	$(PY) -m pytest -m slow $(PARALLEL)

bench: $(BENCH) ## speed, side by side with today's alternatives
	$(PY) -m benchmarks

docs: $(DOCS) ## docs/_build/html/index.html; executes the examples, a warning is an error
	rm -rf docs/generated
	$(PY) -m sphinx --fail-on-warning --keep-going --quiet --fresh-env docs docs/_build/html

pin: ## write constraints.txt anew from the newest versions that fit (setuptools: the interpreter's own, not ours)
	: > $(PINS).new
	$(MAKE) PINS=$(PINS).new --always-make $(RUN)
	$(MAKE) PINS=$(PINS).new $(TEST) $(BENCH) $(DOCS)
	$(PY) -m pip freeze --all --exclude-editable --exclude setuptools > $(PINS).new
	@! grep -v '^[A-Za-z0-9._-]*==[A-Za-z0-9.!+_-]*$$' $(PINS).new || { echo "not plain name==version: see above" >&2; exit 1; }
	mv $(PINS).new $(PINS)
	touch $(RUN) && touch $(TEST) $(BENCH) $(DOCS)

clean: ## remove what make made: .venv, demo-out, docs/_build, caches
	rm -rf $(VENV) demo-out docs/_build docs/generated .pytest_cache .ruff_cache .import_linter_cache .hypothesis $(PINS).new

$(RUN): pyproject.toml $(PINS)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "locbounds needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv --clear $(VENV)
	$(PIP) --upgrade pip
	$(PIP) --group build
	$(PIP) --no-build-isolation --editable .
	@touch $@

$(TEST): $(RUN)
	$(PIP) --group test
	@touch $@

$(BENCH): $(RUN)
	$(PIP) --group bench
	@touch $@

$(DOCS): $(RUN)
	$(PIP) --group docs
	@touch $@
