# Two targets do everything on a machine with Python 3.10 or later and make: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
UV_COMPILE = $(BIN)/uv pip compile pyproject.toml --extra cpu --extra live --universal --python-version 3.10 \
	--constraint requirements/constraints.txt --generate-hashes --no-annotate --no-header --no-emit-index-url --quiet

.PHONY: demo test check slow bench-recording screenshots pins clean

demo: $(VENV)/.run  ## the whole mission on the emulated payload
	$(BIN)/mapforest demo

test: check  ## lint, types, import floors, tests
	$(BIN)/python -m pytest -m "not slow"

check: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

slow: $(VENV)/.dev  ## the long tests: every row of docs/reliability.md
	$(BIN)/python -m pytest -m slow --timeout 1200

bench-recording: $(VENV)/.dev  ## CPU, losses, latency and memory of the recorder: docs/cpu-budget.md
	$(BIN)/python -m benchmarks.recording --memory-minutes 10

screenshots: $(VENV)/.dev  ## the pictures of the README
	$(BIN)/python -m ui.screenshots docs/images
	$(BIN)/python -m drivers.sim.still docs/images/simulated-camera.jpg demo 18

pins: $(VENV)/.dev  ## renew the hashed requirements
	$(BIN)/pip install --quiet uv
	$(UV_COMPILE) --group build --upgrade --output-file requirements/run.txt
	$(UV_COMPILE) --group dev --upgrade --output-file requirements/dev.txt

clean:
	rm -rf $(VENV) build dist demo

$(BIN)/pip:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: requirements/run.txt pyproject.toml | $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements/run.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/.dev: requirements/dev.txt pyproject.toml | $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements/dev.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@
