# Each target sets up what it needs: a virtual environment with the locked versions.
PYTHON ?= python3
CONFIG ?= config/config.yaml
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
LANDMARKS := $(VENV)-mediapipe.ready
DOCS := $(VENV)-docs
RESULTS = $$($(BIN)/python -c 'import sys, yaml; print(yaml.safe_load(open(sys.argv[1])).get("results", "results/demo"))' $(CONFIG))

.PHONY: help setup demo run sketch report verify test test-quick lint format docs reference clean

help:
	@echo "make demo        rebuild everything for two synthetic subjects, and say where to look"
	@echo "make run         the same for CONFIG=config/YOURS.yaml"
	@echo "make sketch      draw the lips of TAKE=subject/take of CONFIG in a browser"
	@echo "make verify      find and remove damaged results of CONFIG"
	@echo "make test        all tests; make test-quick: those that take a minute in all"
	@echo "make lint        style of Python and Snakemake files, docstrings of arrays, types"
	@echo "make docs        build the documentation site (results/site); also regenerates the"
	@echo "                 configuration reference and schemas (make reference: these alone)"
	@echo "make clean       remove the environment and caches (results stay)"

setup: $(READY) $(LANDMARKS)

$(READY): requirements.lock pyproject.toml tools/setup.sh
	tools/setup.sh $(VENV) $(PYTHON)
	@touch $@

# Optional: where it cannot be made, the script says why and the rest works without.
$(LANDMARKS): requirements.mediapipe.lock tools/setup_landmarks.sh | $(READY)
	tools/setup_landmarks.sh $(VENV)-mediapipe $(PYTHON)
	@touch $@

demo: CONFIG = config/config.yaml
demo: run

run: setup
	@$(BIN)/python -m vermilion.app.run $(CONFIG) --quiet rules reason host

sketch: $(READY)
	@$(BIN)/python -m vermilion.app.sketch "$(CONFIG)" "$(TAKE)"

report: $(READY)
	@$(BIN)/python -m vermilion.app.run $(CONFIG) --only-report

verify: $(READY)
	@$(BIN)/python -m vermilion.provenance.checksums "$(RESULTS)"

test: test-quick
	$(BIN)/python -m pytest -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder -m slow

test-quick: setup
	$(BIN)/python -m pytest -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder -m "not slow"

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/python tools/check_docstrings.py src
	$(BIN)/codespell -D - -D tools/words.txt
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

docs: reference $(DOCS)/.ready
	PYTHONPATH=src NO_MKDOCS_2_WARNING=1 $(DOCS)/bin/mkdocs build --quiet --strict
	@echo "documentation: results/site/index.html"

reference: $(READY)
	$(BIN)/python -m vermilion.config.reference

$(DOCS)/.ready: requirements.docs.lock
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --no-input --require-hashes -r $<
	@touch $@

clean:
	rm -rf $(VENV) $(VENV)-mediapipe* $(DOCS) .snakemake .pytest_cache .ruff_cache src/*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
