# Everything from a plain Python >= 3.11 and make: `make demo` or `make test`.

VENV  := .venv
PY    := $(VENV)/bin/python
STAMP := $(VENV)/.installed
UV    ?= uv
# Another interpreter: make PYTHON=/path/to/python test
PYTHON ?=
# Processes of the tests; each keeps one core busy.
WORKERS ?= 2
CANDIDATES = $(or $(PYTHON),python3.11 python3 python3.14 python3.13 python3.12 python)

# Bytecode is kept: each process of the tests would compile all of them again.
TESTS = MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE= $(PY) -m pytest -p no:cacheprovider

.DEFAULT_GOAL := help
.PHONY: help demo paper docs keys pictures screenshots explore browser quick test tests costly kernels check lint types platforms bench campaign slow \
  dense ranges alike exactly trials fuzz pythons lock clean

help:  ## show this list
	@sed -nE 's/^([a-z]+):.*## (.*)$$/  make \1\t\2/p' Makefile | expand -t 18

demo: $(STAMP)  ## walk the branches of the clutch example, into out/
	@mkdir -p out
	$(VENV)/bin/gapwalk run examples/clutch.toml --output out/clutch.gapwalk --force

paper: $(STAMP)  ## reproduce Padmanabhan and Singh (1995) on one page, out/paper/index.html (FIG=13: one figure); goes on where it stopped
	$(PY) -m reproductions.padmanabhan_singh_1995 $(FIG) --output out/paper

explore: $(STAMP)  ## open the examples in the browser (copies of them, in out/)
	@mkdir -p out
	@cp -n examples/*.toml examples/*.mtx examples/*.csv out/ || true
	$(VENV)/bin/gapwalk explore out/clutch.toml

quick: lint  ## lint, and the tests that walk no branch (two minutes at most)
	$(TESTS) --numprocesses=$(WORKERS) --dist=worksteal -m quick

# The look at types fills what the tests leave of the cores while they wait for programs and pages.
test: lint browser  ## lint, types and all tests that are not slow (WORKERS=4: the tests in as many processes)
	@$(MAKE) --no-print-directory --jobs=2 types tests

tests: kernels
	$(TESTS) --numprocesses=$(WORKERS) --dist=worksteal

costly: kernels  ## run the tests of make test, and print those that take over 3 s of CPU time
	$(TESTS) --numprocesses=$(WORKERS) --dist=worksteal --costly=3

# The kernels are compiled before: each process of the tests would compile them again.
kernels: $(STAMP)
	@PYTHONDONTWRITEBYTECODE= $(PY) -m gapwalk.orbit.harmonic_balance.compile_kernels

# The explorer's page is tested in Chromium. Root, as in a container, gets it installed; others are told how.
browser:
	@for name in chromium chromium-browser google-chrome; do command -v $$name >/dev/null && exit 0; done; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "installing chromium for the tests of the explorer"; \
	  (apt-get install -y -qq --no-install-recommends chromium || \
	    (apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium)) >/dev/null 2>&1 && exit 0; \
	fi; \
	echo "no Chromium: the tests of the explorer's page are skipped; apt-get install chromium brings it"

check: lint types  ## lint and types only

lint: $(STAMP)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	@$(PY) -m tests.release.size

types: $(STAMP)
	$(PY) -m basedpyright --pythonpath $(PY)

platforms: $(STAMP)  ## look at the types of src as macOS and Windows have them
	for each in Darwin Windows; do $(PY) -m basedpyright --pythonpath $(PY) --pythonplatform $$each src || exit 1; done

docs: kernels  ## build the documentation into out/docs; check spelling, links, pictures and words; pack it for gapwalk docs
	$(VENV)/bin/codespell README.md CONTRIBUTING.md CHANGELOG.md docs src examples reproductions
	$(PY) -m sphinx --jobs auto --builder html --fail-on-warning --keep-going --doctree-dir out/doctrees docs out/docs
	$(PY) docs/_ext/links.py out/docs
	$(PY) docs/_ext/pictures.py out/docs
	$(PY) docs/_ext/texts.py docs out/docs
	$(PY) docs/_ext/offline.py out/docs src/gapwalk/offline_docs.zip
	@echo "open out/docs/index.html"

keys: $(STAMP)  ## write lists of all keys of model and study files, as Markdown, into docs/reference/generated
	$(PY) -m docs._ext.file_reference

pictures: $(STAMP)  ## make the other pictures of the documentation again, and compare the answers that it quotes
	$(PY) -m docs._ext.made

screenshots: $(STAMP) browser  ## make the pictures of the explorer and of a kept page in the documentation again
	$(PY) -m docs._ext.screenshots
	$(PY) -m tests.explorer.picture docs/pictures/kept.png

bench: $(STAMP)  ## measure the speed, beside the last time (benchmarks/history.jsonl)
	$(PY) -m benchmarks --record

campaign: slow platforms fuzz dense ranges alike exactly trials  ## all that make test leaves out (hours; each of the eight can be made alone)

slow: kernels  ## the tests that are marked as slow (GAPWALK_KILLS=50: kills of each kind of job)
	$(TESTS) -m slow

fuzz: $(STAMP)  ## give the readers more nonsense (GAPWALK_FUZZ=2000 examples of each kind)
	GAPWALK_FUZZ=$${GAPWALK_FUZZ:-2000} $(PY) -m pytest -m hypothesis tests/faults tests/model tests/results tests/studies

dense: $(STAMP)  ## walk the paper's branches and 200 random ones with 20 times smaller steps; goes on where it stopped
	@mkdir -p out
	$(PY) -m tests.bifurcation.dense out/dense.jsonl

ranges: $(STAMP)  ## walk 200 random systems over ranges up to 0.3 ... 1000, and compare; goes on where it stopped
	@mkdir -p out
	$(PY) -m tests.bifurcation.ranges out/ranges.jsonl

exactly: $(STAMP)  ## compute special points of random machines again with 80-bit numbers; goes on where it stopped
	@mkdir -p out
	$(PY) -m tests.bifurcation.exactly out/exactly.jsonl --systems 60

alike: $(STAMP)  ## walk random machines with other steps, mirrored, in other units and from other phases; goes on where it stopped
	@mkdir -p out
	$(PY) -m tests.bifurcation.alike out/alike.jsonl --systems 60

trials: $(STAMP)  ## try 100 random systems with friction and stops; goes on where it stopped
	@mkdir -p out
	$(PY) -m tests.dry.trials out/trials.jsonl --systems 100

pythons: $(STAMP)  ## try the wheel on every Python from 3.11 on that is here, with the newest and the least packages (ONLY=3.12)
	$(PY) -m tests.release.pythons $(ONLY)

lock:  ## make requirements.lock again, with uv (LOCK_FLAGS=--upgrade for newer versions)
	@command -v $(UV) >/dev/null || { \
	  echo "make lock needs uv: install it (pip install uv), or name it: make lock UV=/path/to/uv"; exit 1; }
	$(UV) pip compile pyproject.toml --group dev --universal --python-version 3.11 --generate-hashes \
	  --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" $(LOCK_FLAGS) \
	  --quiet --output-file requirements.lock

clean:  ## remove .venv, caches and results
	rm -rf $(VENV) out dist .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Done once, and again when the lock or the project file changes.
$(STAMP): requirements.lock pyproject.toml | $(PY)
	@echo "Installing the pinned packages into $(VENV); this takes some minutes, once."
	$(PY) -m pip install --quiet --require-hashes --only-binary :all: -r requirements.lock
	$(PY) -m pip install --quiet --no-build-isolation --no-deps --editable .
	$(PY) -m gapwalk.orbit.harmonic_balance.compile_kernels
	@touch $@

# A command named python3.11 may be a shim with nothing behind it, so each candidate is tried.
$(PY):
	@for candidate in $(CANDIDATES); do \
	  if $$candidate -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then \
	    found=$$candidate; break; \
	  fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo "gapwalk needs Python 3.11 or newer; tried and not found: $(CANDIDATES)." \
	    "Install one, or name it: make PYTHON=/path/to/python3.11 test"; \
	  exit 1; \
	fi; \
	echo "making $(VENV) with $$found"; \
	$$found -m venv $(VENV) || { \
	  rm -rf $(VENV); \
	  echo "$$found cannot make a virtual environment with pip in it." \
	    "On Debian and Ubuntu its venv module is a package of its own: apt install python3-venv"; \
	  exit 1; \
	}
