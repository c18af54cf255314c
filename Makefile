# Each target sets itself up on a fresh machine: a virtual environment with the tested set of packages.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
RECORDINGS ?=
OUT ?= demo
RUNS ?= 10000

.PHONY: demo lab test bench fuzz lint clean

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all]'
	touch $(READY)

# the whole story on the bundled sample; RECORDINGS=folder makes the report from other recordings
demo: $(READY)
ifeq ($(strip $(RECORDINGS)),)
	$(BIN)/flexdrive demo -o $(OUT)
else
	$(BIN)/flexdrive report $(RECORDINGS) -o $(OUT)/report.html
endif

# the lab in the browser; RECORDINGS=folder begins with other recordings
lab: $(READY)
	$(BIN)/flexdrive lab $(RECORDINGS)

test: $(READY)
	$(BIN)/python -m pytest -m 'not slow and not docs' -n auto --dist loadfile

# damaged recordings and rig descriptions, seeded; RUNS=100000 for more
fuzz: $(READY)
	$(BIN)/python -m tests.identification.recordings.fuzz --runs $(RUNS)

bench: $(READY)
	$(BIN)/python -m benchmarks

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV) $(OUT)
