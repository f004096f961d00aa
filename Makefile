# Everything runs from the project's own .venv; the first command installs it, later ones do not.
# Another interpreter: make PYTHON=python3.12 test

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed.stamp
DOCS_INSTALLED := $(VENV)/installed-docs.stamp
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help demo paper test quick lint docs bench bench-flights bench-motion bench-fusion bench-live bench-faults bench-corridor bench-axial bench-tune bench-tools readme-check clean
.DEFAULT_GOAL := help

help:
	@echo "make demo          fly a simulated corridor, replay it and write runs/demo/report.html"
	@echo "make test          the whole test suite"
	@echo "make quick         the test suite without the long statistical runs"
	@echo "make lint          style, types and layering"
	@echo "make docs          the documentation, into docs/_build/html"
	@echo "make bench         accuracy on the real flights; also bench-motion, bench-fusion, bench-faults, bench-corridor,"
	@echo "                   bench-live, bench-axial, bench-tune, bench-tools"
	@echo "make paper         the paper's field flights again, simulated: Table 1 and Fig. 11 into runs/paper"
	@echo "make readme-check  run every command of the README in a fresh clone"
	@echo "make clean         remove what the commands above have made, .venv included"

$(BIN)/python:
	@command -v $(PYTHON) > /dev/null || { echo "axialnav needs Python 3.11 or newer, but there is no $(PYTHON); say which one to use: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and "axialnav needs Python 3.11 or newer, but $(PYTHON) is %d.%d; say which one to use: make PYTHON=python3.12" % v[:2])'
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(INSTALLED): pyproject.toml | $(BIN)/python
	@echo "installing axialnav into $(VENV), once; this takes a minute or two"
	@$(PIP) --editable ".[replay,dev]"
	@touch $@

$(DOCS_INSTALLED): $(INSTALLED)
	@echo "installing the documentation tools into $(VENV), once"
	@$(PIP) --editable ".[replay,dev,docs]"
	@touch $@

demo: $(INSTALLED)
	@$(BIN)/axialnav demo

test: $(INSTALLED)
	@$(BIN)/python -m pytest -rfEs -n auto --dist loadfile

quick: $(INSTALLED)
	@$(BIN)/python -m pytest -rfEs -n auto --dist loadfile -m "not slow"

lint: $(INSTALLED)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

docs: $(DOCS_INSTALLED)
	@$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

bench: bench-flights
bench-flights bench-motion bench-fusion bench-faults bench-corridor bench-live bench-axial bench-tune bench-tools: bench-%: $(INSTALLED)
	@$(BIN)/python -m tests.bench.bench_$*

paper: $(INSTALLED)
	@$(BIN)/axialnav motion --experiment field --out runs/paper
	@echo "runs/paper/field.csv runs/paper/field.svg"

readme-check: $(INSTALLED)
	@$(BIN)/python -m tests.readme_check

clean:
	@rm -rf $(VENV) runs build dist docs/_build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
