# Two commands matter: `make reproduce` and `make test`. Both create .venv when it is missing.
PYTHON  ?= python3
PROFILE ?= quick
WORKERS ?= 2

VENV  := .venv
PY    := $(VENV)/bin/python
PIP   := $(PY) -m pip --disable-pip-version-check
READY := $(VENV)/.ready
TRAINS := $(VENV)/.trains
FAST  := tests/core tests/materials tests/stepping tests/scene

# Processes that compile kernels grow, and end with each part: at most 4 GB at a time.
STEPS   := tests/core tests/materials tests/adjoint tests/stepping
METHODS := tests/hot tests/oracle tests/rom tests/nclaw
OTHERS  := tests $(addprefix --ignore=,$(STEPS) $(METHODS))

.DEFAULT_GOAL := help
.PHONY: help reproduce test test-fast test-slow test-all docs standard figures bench learn clean

help:            ## this list
	@sed -n 's/^\([a-z-]*\): [^#]*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

reproduce: $(READY) ## the experiments with a quick profile -> results/quick/report.html and report.md
	$(PY) -m validation run --profile quick --workers $(WORKERS)

test: $(TRAINS)  ## lint and the tests but those marked slow; with PyTorch where a CPU build is on offer
	$(PY) -m ruff check .
	@failed=0; for part in "$(STEPS)" "$(METHODS)" "$(OTHERS)"; do \
	    $(PY) -m pytest -n $(WORKERS) --dist loadfile -m "not slow" $$part || failed=1; done; \
	    exit $$failed

test-fast: $(READY) ## lint and the tests of kernels, materials, steps and scenes: the inner loop
	$(PY) -m ruff check .
	$(PY) -m pytest -n $(WORKERS) --dist loadfile -m "not slow" $(FAST)

test-slow: $(TRAINS) ## the tests marked slow: notebooks, and the longest of the others
	$(PY) -m pytest -n $(WORKERS) --dist loadfile -m slow

test-all: test test-slow ## every test

# Notebooks run when their code changes; make docs NOTEBOOKS=off shows them without results.
NOTEBOOKS ?= cache
SITE      := docs/_build/html

docs: $(READY)   ## the documentation site -> docs/_build/html/index.html; warnings are errors
	$(PIP) install -c constraints.txt -e '.[docs]'
	MPM_REF_NOTEBOOKS=$(NOTEBOOKS) $(PY) -m sphinx -q -W --keep-going -n -j $(WORKERS) docs $(SITE)
	$(PY) docs/check_links.py $(SITE)

standard: $(READY) ## every experiment at the standard profile (hours) -> results/standard
	$(PY) -m validation run --profile standard

figures: $(READY) ## draw the figures again from the results of PROFILE (default: quick)
	$(PY) -m figures --profile $(PROFILE) --workers $(WORKERS)

bench: $(READY)  ## our kernels beside Taichi and Warp (installs both), features, implicit steps
	$(PIP) install -c constraints.txt -e '.[bench]'
	$(PY) -m benchmarks blocks
	$(PY) -m benchmarks gradients
	$(PY) -m pytest -q tests/oracle/test_conformance.py
	$(PY) -m benchmarks conformance
	$(PY) -m benchmarks features
	$(PY) -m benchmarks hot
	$(PY) -m benchmarks hot-runs

# PyPI's torch for Linux is the CUDA build: about 2.7 GB of wheels. The CPU build (0.2 GB) has an
# index of its own; docs/howto/rerun-experiments.md tells how to find it: make learn TORCH_INDEX=<that address>.
# So pip is first asked what it would take; a CUDA build is installed only on request (TORCH=any).
TORCH_INDEX ?=
TORCH       ?= cpu
TORCH_FROM  := $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX))

learn: $(READY)  ## add PyTorch (CPU build) for what trains; see docs/howto/rerun-experiments.md
	@if [ "$(TORCH)" != any ] && $(PIP) install --dry-run --no-deps --quiet --report - \
	        $(TORCH_FROM) -c constraints.txt torch | grep -Eq '"(nvidia|cuda)-'; then \
	    echo "make learn: pip would take the CUDA build of torch, about 2.7 GB. Either name the"; \
	    echo "index of the CPU builds, make learn TORCH_INDEX=... (docs/howto/rerun-experiments.md),"; \
	    echo "or accept the CUDA build: make learn TORCH=any. Nothing was installed."; \
	    exit 1; \
	fi
	$(PIP) install $(TORCH_FROM) -c constraints.txt -e '.[learn]'

# The tests of what trains are skipped without PyTorch; a CUDA build is never installed for them.
$(TRAINS): $(READY)
	@$(MAKE) --no-print-directory learn || \
	    echo "No CPU build of PyTorch at hand: the tests of what trains are skipped."
	@touch $@

clean:           ## remove caches, the site and the quick results (the environment .venv stays)
	rm -rf docs/_build results/quick .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(PY):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "$$($(PYTHON) --version) found, 3.11 or newer needed: make PYTHON=python3.12 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(READY): pyproject.toml constraints.txt | $(PY)
	$(PIP) install --no-compile -c constraints.txt -e '.[test]'
	@touch $@
