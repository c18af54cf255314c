# Each target sets itself up on a fresh machine: a virtual environment with the tested set of packages.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
RECORDINGS ?=
OUT ?= demo
RUNS ?= 10000
ONLY ?=

# on 3.12 and later the pinned PyTorch brings gigabytes of CUDA; only training needs it (docs/install.md)
EXTRAS ?= $(shell $(PYTHON) -c "import sys; print('all' if sys.version_info < (3, 12) else 'no-torch,dev,docs,notebooks')")

.PHONY: demo lab test docs notebooks package bench fuzz lint clean

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[$(EXTRAS)]'
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

# the documentation as one site: site/index.html, which opens without a server
docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# the tutorials, each as a script
notebooks: $(READY)
	$(BIN)/python -m pytest -m slow tests/docs/test_notebooks.py

# wheel and sdist, tried in a clean environment of every Python from 3.11 to 3.13 found here; ONLY=3.12 or ONLY=running for one
package: $(READY)
	$(BIN)/python .ci/package.py $(if $(ONLY),--only $(ONLY))

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
	rm -rf $(VENV) $(OUT) site
