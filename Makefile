# `make demo` and `make test` do all the set-up they need on Debian 12 or newer and Ubuntu 25.04 or newer, and on x86-64
# Linux without root by a third party's wheel (WHEEL=1); elsewhere name a Python that has FEniCSx:
#     make demo PYTHON=/path/to/python

DEMO ?= chain_links
NOTEBOOKS ?=
SIZE ?=
OBJECTIVE ?=
NP ?= 1
BENCH ?= full
STUDIES ?= hertz cattaneo_mindlin chain_links
PYTHON ?=
WHEEL ?=
JOBS ?= 2
ROOM ?=
COUNT ?= 1000
KIND ?= linear
export WHEEL

ifeq ($(strip $(PYTHON)),)
python := .venv/bin/python
prepare := setup
prepare_demo := setup-demo
export PYTHONNOUSERSITE := 1
else
python := $(PYTHON)
prepare :=
prepare_demo :=
endif
launch := scripts/launch.sh

.DEFAULT_GOAL := help
.PHONY: help demo demos notebooks test coverage test-core test-slow test-hard test-claims mutants random-scenes spoilt-files docs benchmark studies study-constants study-optimisation study-optimisers study-surfaces study-others study-adaptive study-large study-peers lint setup setup-demo

help: ## Show this list
	@echo "Targets:"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 20
	@echo "Settings:"
	@echo "  DEMO=hertz_sphere    which demo (chain_links); all are in demos/"
	@echo "  NOTEBOOKS=\"01 04\"    which notebooks (all)"
	@echo "  SIZE=small|paper     size of the chain links (paper), of the roller small|full (full)"
	@echo "  OBJECTIVE=pressure   what the shape of the chain links lowers: potential|energy|pressure (potential)"
	@echo "  NP=2                 MPI ranks of a demo (1)"
	@echo "  STUDIES=hertz        which studies (all three); NP ranks each"
	@echo "  BENCH=quick|full     small cases once, or all of them (full)"
	@echo "  JOBS=4               tests at a time (2)"
	@echo "  ROOM=\"decks scene\"   rooms whose tests alone \`make test\` runs, by their folders in tests/ (all)"
	@echo "  COUNT=200            how many random scenes or spoilt files (1000)"
	@echo "  PYTHON=/some/python  use this Python and its FEniCSx instead of setting up .venv"
	@echo "  WHEEL=1              set up FEniCSx without root, by a third party's wheel, which is alpha (0: by packages)"

demo: $(prepare_demo) ## Optimise the contact shape of two chain links, or run DEMO=...; results in output/
	$(launch) $(NP) $(python) demos/demo_$(DEMO).py $(if $(SIZE),--size $(SIZE)) $(if $(OBJECTIVE),--objective $(OBJECTIVE))

demos: $(prepare_demo) ## Run every demo
	for demo in demos/demo_*.py; do $(launch) $(NP) $(python) $$demo || exit 1; done

notebooks: $(prepare) ## Run the notebooks and store what they show, or NOTEBOOKS="01 04"; pages in output/notebooks/
	$(launch) 1 $(python) notebooks/execute.py $(NOTEBOOKS)

quick = $(launch) 1 $(python) -m pytest -n $(JOBS) --dist loadfile -m "not slow and not hard and not claim"

# What ROOM="decks scene" looks at: the rooms, their tests, and the rules of the house that every room keeps.
tested := $(ROOM:%=tests/%)
parts := $(wildcard $(tested) $(foreach room,$(ROOM),fenics_contact/$(room) fenics_contact/_$(room) fenics_contact/$(room).py \
  tools/$(room) $(filter $(room),benchmarks demos notebooks)))
rules := $(addprefix tests/house/test_, habits.py imports.py public_names.py ratchet.py words.py)
missing := $(filter-out $(wildcard $(tested)),$(tested))

test: $(if $(strip $(ROOM)),$(prepare),lint) ## Check style and types, run the quick tests and the quick benchmark; or of ROOM=decks alone
ifeq ($(strip $(ROOM)),)
	$(quick)
	$(python) -m benchmarks --quick
else
	@$(if $(missing),echo "$(missing): no such folder; rooms are" $(notdir $(patsubst %/,%,$(wildcard tests/*/))) >&2; exit 2)
	$(python) -m ruff check $(parts)
	$(python) -m ruff format --check --quiet $(parts)
	$(python) -m mypy $(parts)
	$(quick) $(tested) $(rules)
endif

core := tests/dolfinx $(addprefix tests/pairing/test_, patch.py quadratic_cells.py) \
  $(addprefix tests/equilibrium/test_, coulomb.py hertz.py ranks.py) \
  tests/design/test_adjoint.py tests/design/test_derivatives.py tests/materials/test_hyperelasticity.py \
  tests/large_deformations/test_sliding.py $(addprefix tests/readers/test_, dolfinx_import.py meshio_import.py \
  gmsh_import.py) tests/decks/test_composites.py tests/house/test_starting.py

test-core: $(prepare) ## Run the most telling tests: patches, Coulomb, derivatives, large deformations, meshes, ranks
	$(quick) $(core)

test-slow: $(prepare) ## Run the tests that take long
	$(launch) 1 $(python) -m pytest -m slow

coverage: $(prepare) ## Count the lines and branches that the quick tests reach; output/coverage/index.html
	@mkdir -p output
	$(launch) 1 $(python) -m coverage run -m pytest -n $(JOBS) --dist loadfile -m "not slow and not hard and not claim" $(tested)
	$(python) -m coverage combine -q
	$(python) -m coverage html -q
	$(python) -m coverage report --format=total

test-hard: $(prepare) ## Run the hard cases; writes docs/hard_cases.md
	$(launch) 1 $(python) -m pytest tests/hard -m hard --hard-table docs/hard_cases.md

test-claims: $(prepare) ## Run what claims rest on: effectivity under contact, certificates, hard cases once, demos, four ranks, the site, mutants
	$(launch) 1 $(python) -m pytest -n $(JOBS) --dist worksteal -m claim

mutants: $(prepare) ## Make mistakes in a copy of the package, which the quick tests must find
	$(launch) 1 $(python) -m pytest tests/mutants -m slow

random-scenes: $(prepare) ## Solve COUNT scenes made from seeds and verify every answer by other means, or KIND=deformed|corners|meetings
	$(python) -m tools.random_scenes --count $(COUNT) --kind $(KIND) --processes $(JOBS)

spoilt-files: $(prepare) ## Plan COUNT decks, scene files, meshes and tools with mistakes: planned or refused in words
	$(python) -m tools.mutated --count $(COUNT)

docs: $(prepare) ## Build the documentation; output/docs/index.html
	$(launch) 1 $(python) -m sphinx -W --keep-going -q -c docs -d output/docs-doctrees . output/docs
	@echo "Open output/docs/index.html in a browser"

study-constants: $(prepare) ## Halve and double every constant of the library; docs/studies/
	$(python) -m benchmarks constants $(if $(filter quick,$(BENCH)),--quick)

study-optimisation: $(prepare) ## Measure what state tolerances do to an optimisation; docs/studies/
	$(python) -m benchmarks optimisation_tolerance $(if $(filter quick,$(BENCH)),--quick)

study-optimisers: $(prepare) ## Compare SciPy's optimisers with the bundle method; docs/studies/
	$(python) -m benchmarks optimisers $(if $(filter quick,$(BENCH)),--quick)

study-surfaces: $(prepare) ## Compare facets, reconstructed and true surfaces with theory; docs/studies/
	$(python) -m benchmarks true_surfaces $(if $(filter quick,$(BENCH)),--quick)

study-others: $(prepare) ## Solve published problems, with error bars; docs/studies/
	$(python) -m benchmarks others $(if $(filter quick,$(BENCH)),--quick)

study-adaptive: $(prepare) ## Refine meshes where it pays, and everywhere; docs/studies/
	$(python) -m benchmarks adaptive $(if $(filter quick,$(BENCH)),--quick)

study-large: $(prepare) ## Solve published problems of plasticity and large deformations; docs/studies/
	$(python) -m benchmarks large_deformations $(if $(filter quick,$(BENCH)),--quick)

study-peers: $(prepare) ## Solve the same scenes by other programs that are installed; docs/studies/
	$(python) -m benchmarks peers $(if $(filter quick,$(BENCH)),--quick)

benchmark: $(prepare) ## Measure time, memory and products; results in benchmarks/
	$(python) -m benchmarks $(if $(filter quick,$(BENCH)),--quick)

studies: $(prepare) ## Measure what accuracy costs in time; results in docs/studies/
	for study in $(STUDIES); do $(launch) 1 $(python) -m fenics_contact accuracy $$study --ranks $(NP) \
	  --output docs/studies/$$study --runs output/studies/$$study || exit 1; done
	$(python) -m benchmarks.studies_page docs/studies

lint: $(prepare) ## Check style and format (ruff), and types where NumPy is of version 1 (mypy)
	$(python) -m ruff check .
	$(python) -m ruff format --check --quiet .
	@if $(python) -c 'import numpy; raise SystemExit(numpy.__version__ >= "2")'; then \
	  echo "$(python) -m mypy"; $(python) -m mypy; \
	else echo "types are checked with the stubs of NumPy 1, as on Debian 12: not here"; fi

setup-demo: ## Install what the package and its demos need: packages of the system and .venv
	@scripts/setup.sh

setup: ## Install the tools of developers, too
	@scripts/setup.sh --dev
