# Each target sets up what it needs: a virtual environment with the locked versions.
PYTHON ?= python3
CONFIG ?= config/config.yaml
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
LANDMARKS := $(VENV)-mediapipe.ready
DOCS := $(VENV)-docs
VERMILION = $(BIN)/python -m vermilion.app

.PHONY: help setup demo lips generic run cameras plates sketch doctor report verify clean-intermediate test test-quick test-latest test-faults test-kills test-interchange test-slurm test-cloud lint format docs reference clean

# A variable that is misspelt on the command line would go unnoticed.
TAKEN := PYTHON VENV CONFIG VIDEO MODEL SCAN EYES OUT FIRST LAST PEOPLE TAKE FORMAT
# Variables of this file, of make, and of the programs that it starts, which get what the command line sets.
PASSED := BIN READY LANDMARKS DOCS VERMILION PYTEST MAKE% SHELL GNUMAKEFLAGS PYTHONPATH PYTHONDONTWRITEBYTECODE \
    HOME PATH TMPDIR LANG LC_% VERMILION_% SNAKEMAKE_% PYTEST_% PIP_% UV_% XDG_% OMP_% NUMBA_% \
    SSL_% %_proxy %_PROXY
GIVEN := $(foreach name,$(.VARIABLES),$(if $(filter command,$(firstword $(origin $(name)))),$(name)))
UNKNOWN := $(strip $(filter-out $(TAKEN) $(PASSED),$(GIVEN)))
# A make above this one hands on variables of its own.
ifeq ($(MAKELEVEL),0)
ifneq ($(UNKNOWN),)
$(error Nothing here reads $(UNKNOWN); the variables are $(TAKEN). Correct the name (make help says what each is for))
endif
endif

# Before the set-up, which takes minutes.
ifneq ($(filter lips,$(MAKECMDGOALS)),)
ifeq ($(strip $(VIDEO)),)
$(error Name a video: make lips VIDEO=clip.mp4 (or an image, or a folder of numbered images))
endif
ifeq ($(filter ~%,$(VIDEO))$(shell test -e "$(VIDEO)" || echo absent),absent)
$(error There is no file or folder $(VIDEO); correct VIDEO)
endif
endif

help:
	@echo "make demo        rebuild everything for two synthetic subjects, and say where to look"
	@echo "make lips        better lips for VIDEO=clip.mp4 or photo.jpg: files and a page (MODEL=generic or FILE.h5,"
	@echo "                 SCAN=neutral.obj or EYES=63 mm between the pupils, OUT=folder, FIRST= and LAST= frame)"
	@echo "make run         the same for CONFIG=config/YOURS.yaml"
	@echo "make generic     train the regressor of models/ on sixty synthetic people, or PEOPLE= (MODEL=generic)"
	@echo "make sketch      draw the lips of TAKE=subject/take of CONFIG in a browser"
	@echo "make doctor      say what is missing, and what to do about it"
	@echo "make cameras     say what is understood of the cameras of CONFIG, and draw them"
	@echo "make plates      frontal images of CONFIG without tattoo, with their camera, for your tracker"
	@echo "                 (TAKE=subject/take, FORMAT=png|exr|mov, OUT=folder)"
	@echo "make verify      find and remove damaged results of CONFIG"
	@echo "make clean-intermediate  remove results of CONFIG that only the next stages read, and say how much that is"
	@echo "make test        all tests; make test-quick: those that take a minute in all"
	@echo "make test-latest the quick tests with the newest versions of all packages"
	@echo "make test-slurm  the tiny capture on a real Slurm of two nodes (as root)"
	@echo "make test-kills  200 kills over the whole tiny run, 20 full disks (as root)"
	@echo "make test-cloud  results in a bucket, and the jobs that Kubernetes is given"
	@echo "make test-interchange  Blender and the validators of USD and glTF open what is exported"
	@echo "make lint        style of Python and Snakemake files, docstrings of arrays, types"
	@echo "make docs        build the documentation site (results/site); also regenerates the"
	@echo "                 configuration reference and schemas (make reference: these alone)"
	@echo "make clean       remove the environment and caches (results stay)"
	@echo "PYTHON=python3.12  the Python of the environments"

setup: $(READY) $(LANDMARKS)

$(READY): requirements.lock pyproject.toml tools/setup.sh
	tools/setup.sh $(VENV) $(PYTHON)
	@touch $@

# Optional: where it cannot be made, the script says why and the rest works without.
$(LANDMARKS): requirements.mediapipe.lock tools/setup_landmarks.sh | $(READY)
	tools/setup_landmarks.sh $(VENV)-mediapipe $(PYTHON)
	@touch $@

# Its landmarks are found by the embedded regressor, without the network.
demo: $(READY)
	@$(VERMILION) demo

generic: setup
	@$(VERMILION) generic $(if $(PEOPLE),--people $(PEOPLE))

lips: setup
	@$(VERMILION) lips "$(VIDEO)" $(if $(MODEL),--model "$(MODEL)") $(if $(SCAN),--scan "$(SCAN)") \
	    $(if $(EYES),--eye-distance "$(EYES)") $(if $(OUT),--out "$(OUT)") \
	    $(if $(FIRST),--first $(FIRST)) $(if $(LAST),--last $(LAST))

run: setup
	@$(VERMILION) run "$(CONFIG)"

doctor: $(READY)
	@$(VERMILION) doctor

sketch: $(READY)
	@$(VERMILION) sketch "$(CONFIG)" "$(TAKE)"

cameras: $(READY)
	@$(VERMILION) cameras "$(CONFIG)"

plates: $(READY)
	@$(VERMILION) plates "$(CONFIG)" $(if $(TAKE),--take "$(TAKE)") $(if $(FORMAT),--format $(FORMAT)) \
	    $(if $(OUT),--out "$(OUT)")

report: $(READY)
	@$(VERMILION) report "$(CONFIG)"

verify: $(READY)
	@$(VERMILION) verify "$(CONFIG)"

clean-intermediate: $(READY)
	@$(VERMILION) clean-intermediate "$(CONFIG)"

# Compiled test files are kept, also where the environment says not to: half of a process's start.
PYTEST = PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder

test: test-quick
	$(PYTEST) -m slow --durations=30 --durations-min=10

test-quick: setup
	$(PYTEST) -m "not slow"

# What the newest versions of all packages break is found here before users find it.
test-latest:
	tools/setup.sh $(VENV)-latest $(PYTHON) latest
	$(VENV)-latest/bin/python -m pytest -n logical --maxprocesses 8 --dist loadfile -m "not slow"

# Not in `make test`: Blender (374 MB), the validators of USD and glTF. What cannot be made is skipped.
test-interchange: $(READY) $(VENV)-interchange.ready
	VERMILION_INTERCHANGE=$(VENV)-interchange $(BIN)/python -m pytest -p no:cacheprovider tests/interchange

$(VENV)-interchange.ready: requirements.interchange.lock tools/setup_interchange.sh | $(READY)
	tools/setup_interchange.sh $(VENV)-interchange $(PYTHON)
	@touch $@

# The malformed inputs with more seeds than in `make test`; about a minute of one core for 20.
test-faults: setup
	VERMILION_FAULT_SEEDS=$${VERMILION_FAULT_SEEDS:-20} $(BIN)/python -m pytest -p no:cacheprovider tests/faults

# 200 kills over the whole tiny run, 20 full disks; about an hour of one core. As root; VERMILION_KILLS_FOLDER=
# keeps the undisturbed run that the others are compared with.
test-kills: setup
	VERMILION_KILLS=$${VERMILION_KILLS:-200} VERMILION_FULL_DISKS=$${VERMILION_FULL_DISKS:-10} \
	    $(BIN)/python -m pytest -p no:cacheprovider -s tests/workflow/test_kills.py tests/workflow/test_disks.py

# A real Slurm of two nodes on this machine; needs root. VERMILION_TEST_SLURM=all compares a whole run;
# VERMILION_SLURM_ACCOUNTING=1: with an accounting database (slurmdbd, mariadb-server).
test-slurm: setup
	VERMILION_TEST_SLURM=$${VERMILION_TEST_SLURM:-1} $(BIN)/python -m pytest tests/slurm

# A server of this machine that speaks S3, and one that takes jobs as Kubernetes does.
test-cloud: setup .venv-cloud.ready
	VERMILION_CLOUD=.venv-cloud $(BIN)/python -m pytest -p no:cacheprovider tests/cloud

.venv-cloud.ready: requirements.cloud.lock tools/setup_cloud.sh | $(READY)
	tools/setup_cloud.sh .venv-cloud $(BIN)/python
	@touch $@

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
	rm -rf $(VENV) $(VENV)-latest $(VENV)-mediapipe* $(VENV)-interchange* $(VENV)-cloud* $(DOCS) .snakemake .pytest_cache .ruff_cache src/*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
