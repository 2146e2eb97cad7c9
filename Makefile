# `make reproduce-figures` and `make test` need nothing but Python 3.11 or 3.12 and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
RUNS := runs
# Overrides for every experiment of reproduce-figures, for instance OVERRIDES='seeds=1 algorithm.iterations=5'.
OVERRIDES :=

# Parallelism lies between runs; the small matrices within one gain nothing from threads of their own.
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1

# Each command would compile every module again, and that is most of a short command's time.
unexport PYTHONDONTWRITEBYTECODE

# Of the Pythons that pyproject.toml allows, those that PATH has.
VERSIONS = $(foreach python,3.11 3.12,$(if $(shell python$(python) -c 'print(1)' 2>/dev/null),lowest-$(python) newest-$(python)))

.PHONY: help reproduce-figures test test-versions lint types bench fuzz kill attack grammar grid-search docs clean

help:
	@grep -E '^## ' $(MAKEFILE_LIST) | sed 's/^## //'

# A newer pip needs half the time for what follows; without one, the old one does it.
$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13) and "tltlrl needs Python 3.11 or 3.12; say which: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	-$(BIN)/python -m pip install --quiet --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.[dev]'
	@touch $@

## make reproduce-figures: figures 3.3 and 3.4, the case study's claims and the smoothness of toast_smooth.tltl, at the case study's full budget, into runs/
reproduce-figures: $(READY)
	$(BIN)/tltl-run experiment=reach_avoid runs_dir=$(RUNS) $(OVERRIDES)
	$(BIN)/tltl-run experiment=visit_in_order runs_dir=$(RUNS) $(OVERRIDES)
	$(BIN)/tltl plot $(RUNS)/reach_avoid $(RUNS)/visit_in_order --output $(RUNS)/figure_3_3
	$(BIN)/tltl-run experiment=toast runs_dir=$(RUNS) $(OVERRIDES)
	$(BIN)/tltl plot $(RUNS)/toast --output $(RUNS)/figure_3_4
	$(BIN)/tltl-run experiment=toast name=toast_smooth spec=toast_smooth.tltl 'cases=[tltl_episodic]' runs_dir=$(RUNS) $(OVERRIDES)
	$(BIN)/python -m studies.smoothness $(RUNS)/toast $(RUNS)/toast_smooth --output $(RUNS)/smoothness.csv | tee $(RUNS)/smoothness.txt
	$(BIN)/python -m studies.claims $(RUNS)/reach_avoid $(RUNS)/visit_in_order $(RUNS)/toast

## make test: lint, types, tests, and a short run of each experiment through the real command
test: lint types
	$(BIN)/python -m pytest --numprocesses logical --dist worksteal

## make test-versions: the tests with the lowest versions that pyproject.toml allows and with the newest of everything, on Python 3.11 and 3.12, as far as PATH has them
test-versions: $(VERSIONS:%=test-%)

.versions/lowest.txt: pyproject.toml studies/lowest.py
	@mkdir -p .versions
	$(PYTHON) -m studies.lowest > $@

test-lowest-%: .versions/lowest.txt
	python$* -m venv --clear .versions/lowest-$*
	.versions/lowest-$*/bin/python -m pip install --quiet --constraint $< --editable '.[dev]'
	.versions/lowest-$*/bin/python -m pytest --numprocesses logical --dist worksteal

test-newest-%:
	python$* -m venv --clear .versions/newest-$*
	.versions/newest-$*/bin/python -m pip install --quiet --editable '.[dev]'
	.versions/newest-$*/bin/python -m pytest --numprocesses logical --dist worksteal

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy --num-workers 2

## make bench: measured speeds beside their targets
bench: $(READY)
	$(BIN)/python -m benchmarks

## make fuzz: 100 000 mutated specs, each of which must give a formula or a message
fuzz: $(READY)
	TLTL_FUZZ=100000 $(BIN)/python -m pytest tests/logic/test_language.py -k fuzz

## make kill: tltl-run killed at 3 x 20 moments of its writing, with one and two workers, and started again (TLTL_KILLS=20)
kill: $(READY)
	TLTL_KILLS=$${TLTL_KILLS:-20} $(BIN)/python -m pytest -s tests/store/test_killed.py

## make attack: 60 kills of tltl-run and 50 of the other commands that write, 200 damaged and 60 forged files
attack: kill
	$(BIN)/python -m studies.attack --damages 200 --forged 60 --kills 50

## make grammar: the tables of tltlrl/logic/grammar.lark, after a change of it
grammar: $(READY)
	$(BIN)/python -c "from tltlrl.logic.grammar import write_tables; write_tables()"

## make grid-search: coefficients of the hand-made rewards on seeds of their own, into studies/grid_search_*.csv
grid-search: $(READY)
	$(BIN)/python -m studies.grid_search reach_avoid visit_in_order toast

## make docs: the pages as a site, build/docs/docs/index.html
docs: $(READY)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --builder html --conf-dir docs . build/docs

## make clean: remove the environment and the caches; results in runs/ stay
clean:
	rm -rf $(VENV) .versions .pytest_cache .mypy_cache .ruff_cache .hypothesis
