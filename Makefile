# `make demo` and `make test` do all the set-up they need on Debian 12 and 13; elsewhere name a Python that has FEniCSx:
#     make demo PYTHON=/path/to/python

SIZE ?= paper
NP ?= 1
BENCH ?= full
PYTHON ?=

ifeq ($(strip $(PYTHON)),)
python := .venv/bin/python
prepare := setup
export PYTHONNOUSERSITE := 1
else
python := $(PYTHON)
prepare :=
endif
launch := scripts/launch.sh

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow benchmark lint setup

help: ## Show this list
	@echo "Targets:"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 20
	@echo "Settings:"
	@echo "  SIZE=small|paper     size of the demo (paper)"
	@echo "  NP=2                 MPI ranks of the demo (1)"
	@echo "  BENCH=quick|full     small cases once, or all of them (full)"
	@echo "  PYTHON=/some/python  use this Python and its FEniCSx instead of setting up .venv"

demo: $(prepare) ## Optimise the contact shape of two chain links; results in output/chain_links/
	$(launch) $(NP) $(python) demos/demo_chain_links.py --size $(SIZE)

test: lint ## Check style and types, run the quick tests
	$(launch) 1 $(python) -m pytest -m "not slow"

test-slow: $(prepare) ## Run the tests that take long
	$(launch) 1 $(python) -m pytest -m slow

benchmark: $(prepare) ## Measure time, memory and products; results in benchmarks/
	$(python) -m benchmarks $(if $(filter quick,$(BENCH)),--quick)

lint: $(prepare) ## Check style (ruff) and types (mypy)
	$(python) -m ruff check .
	$(python) -m mypy

setup: ## Install what is missing: Debian packages and .venv
	@scripts/setup.sh
