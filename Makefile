# `make` lists the targets. Everything lands in .venv and runs/; nothing outside the checkout changes.

VENV ?= .venv
# The first Python that is new enough; override with PYTHON=python3.12.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	command -v $$p >/dev/null && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' && echo $$p && break; done)
# The CPU build is enough for everything here. For a CUDA build: make venv TORCH_INDEX=
TORCH ?= torch==2.13.0
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu

JOBS ?= 2
SCENE ?= home:flat:1
AGENT ?= anm:best
STEPS ?= 600
OUT ?= runs/demo
CONFIG ?= configs/tiny.yaml

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# One thread per process: the tests and the maps use small arrays, and runs repeat bit for bit.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help venv install demo test test-slow check format report clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

venv: $(VENV)/.test ## create .venv with everything that the demo and the tests need
install: venv ## the same as venv

demo: venv ## let an agent explore a procedural home and draw what it saw
	$(BIN)/python -m train.explore --scene $(SCENE) --agent $(AGENT) --steps $(STEPS) --out $(OUT)
	@echo "pictures and report: $(abspath $(OUT))"
	@ls $(OUT)

test: venv ## run the tests
	$(BIN)/python -m pytest -n $(JOBS)

test-slow: venv ## run the tests, the slow ones too
	$(BIN)/python -m pytest -n $(JOBS) --slow

check: $(VENV)/.dev ## format, lint, types, import floors and tests, as a change must pass them
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest tests/test_architecture.py
	$(BIN)/python -m pytest -n $(JOBS) --deselect tests/test_architecture.py

format: $(VENV)/.dev ## format the code and mend what ruff can mend
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

report: venv ## compare agents as CONFIG says and write table, curves and report
	$(BIN)/python -m train.evaluate --config $(CONFIG)

clean: ## remove .venv and the caches, but not runs/
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache

$(VENV)/.test $(VENV)/.dev: $(VENV)/.%: $(VENV)/.torch pyproject.toml
	$(PIP) install --editable ".[$*]"
	@touch $@

# torch comes first and from its own index, because the default one may hold a CUDA build of several
# gigabytes. Where that index cannot be reached, the configured ones have to do.
$(VENV)/.torch: | $(VENV)/bin/python
	@if [ -n "$(TORCH_INDEX)" ] && $(BIN)/python -c \
		'import sys, urllib.request as r; r.urlopen(sys.argv[1], timeout=10)' "$(TORCH_INDEX)/torch/" 2>/dev/null; \
	then set -x; $(PIP) install "$(TORCH)" --index-url "$(TORCH_INDEX)"; \
	else set -x; $(PIP) install "$(TORCH)"; fi
	@touch $@

$(VENV)/bin/python:
	@[ -n "$(PYTHON)" ] || { echo "Python 3.11 or newer must be installed; name it with PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "$(PYTHON) cannot create environments; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
