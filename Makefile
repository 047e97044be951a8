# gesture_bot: `make demo` and `make test` set everything up in .venv by themselves.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# URDFs for the tests; the simulators that they depend on are not needed, and example-robot-data adds three more.
ROBOTS := qibullet==1.4.6 poppy-torso==3.0.0
# PyTorch without the CUDA libraries, which take gigabytes; where it cannot be reached, the usual one does.
TORCH := https://download.pytorch.org/whl/cpu
INSTALLED := base cli nodes speech corpus matching refine retarget servo evaluate recording studio msg action config launch
SOURCES := CMakeLists.txt pyproject.toml package.xml README.md LICENSE \
           $(shell find $(INSTALLED) -type f -not -name '*.pyc')

# The benches load onnxruntime, which reports what it runs on otherwise (docs/security.md).
export ORT_DISABLE_TELEMETRY = 1

.PHONY: demo test lint format soak clean
.DELETE_ON_ERROR:

demo: $(VENV)/installed
	$(BIN)/gesture-bot demo

test: $(VENV)/installed-dev lint
	$(BIN)/pytest -m live
	$(BIN)/pytest -m "not live" -n auto --dist loadfile

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy -p gesture_bot

format: $(VENV)/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench-%: $(VENV)/installed-dev
	$(BIN)/python bench/$(subst -,_,$*).py

soak: $(VENV)/installed-dev
	$(BIN)/python bench/soak.py

clean:
	rm -rf $(VENV) build install log demo_out .mypy_cache .ruff_cache .pytest_cache

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14) and "gesture_bot needs Python 3.11 to 3.13; try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip

$(VENV)/installed: $(BIN)/python $(SOURCES)
	$(BIN)/pip install --progress-bar on .
	touch $@

$(VENV)/installed-dev: $(BIN)/python $(SOURCES)
	$(BIN)/pip install --progress-bar on --index-url $(TORCH) --timeout 10 --retries 0 torch || \
	  $(BIN)/pip install --progress-bar on torch
	$(BIN)/pip install --progress-bar on '.[dev,train]'
	$(BIN)/pip install --quiet --no-deps $(ROBOTS)
	touch $@ $(VENV)/installed
