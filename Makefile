# make demo   install what is missing, run the main job on the synthetic world
# make test   install what is missing, run the tests (PYTEST_ARGS=... to choose some)
# make lint   ruff and mypy
# make pictures  retake the pictures of README.md and docs/, in the real viewer
# make clean  remove what these made
#
# Needs Python 3.11 or newer (PYTHON=... to choose one). Installs into .venv, nothing into the system,
# except as root the Debian packages that .ci/system-libraries finds missing.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq
DEMO_ARGS ?=
PYTEST_ARGS ?= -n auto --maxprocesses 4 --dist loadfile

PICTURES := overview cascade-all-stages cost-volumes-stage-3-which hourglass-stage-3-where 3d-side-by-side whole-drive

.PHONY: demo test lint pictures clean libraries viewer-libraries

demo: libraries $(VENV)/installed
	$(BIN)/calib-inspect demo $(DEMO_ARGS)

test: viewer-libraries $(VENV)/installed-dev
	$(BIN)/python -m pytest $(PYTEST_ARGS)

lint: $(VENV)/installed-dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

pictures: viewer-libraries $(VENV)/installed-dev
	$(BIN)/calib-inspect demo --drive --headless --save recordings/pictures.rrd
	$(BIN)/calib-inspect pictures recordings/pictures.rrd --output docs/pictures --size 1366x768 $(PICTURES:%=--tab %)
	$(BIN)/calib-inspect demo --range 20/1.5 --log overlays --headless --save recordings/stages.rrd
	$(BIN)/calib-inspect pictures recordings/stages.rrd --animate docs/pictures/corrected-stage-by-stage.webp
	$(BIN)/python .ci/live-picture docs/pictures/live.webp

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache

libraries:
	@.ci/system-libraries

viewer-libraries:
	@.ci/system-libraries viewer

# The stamps say what was finished: a second run does nothing until a requirement changes.
$(VENV)/created:
	@.ci/create-venv $(PYTHON) $(VENV)
	@touch $@

$(VENV)/installed: $(VENV)/created pyproject.toml constraints.txt
	@echo "Installing calib-inspect (the first time 1 GB is downloaded)"
	@$(PIP) install -c constraints.txt -e .
	@touch $@

$(VENV)/installed-dev: $(VENV)/created pyproject.toml constraints.txt
	@echo "Installing calib-inspect and its development tools (the first time 1 GB is downloaded)"
	@$(PIP) install -c constraints.txt -e '.[dev]'
	@touch $@ $(VENV)/installed
