# In Bounds. `make help` lists what there is; every target sets up what it needs and may be run again at any time.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.ONESHELL:

PY := .venv/bin/python
# Seeds in lockstep are one program on one core: more threads only make it slower (CONTRIBUTING.md, "Speed").
export OMP_NUM_THREADS ?= 1
NB ?= $(wildcard notebooks/*.ipynb)
PORT ?= 8000

.PHONY: help setup book quick test mutants check format notebooks pages lighthouse pdf slides serve lab bench dist clean distclean

help:  ## list these targets
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

setup:  ## create .venv and install the pinned packages (the other targets do this themselves)
	@tools/setup.sh

book: setup  ## execute the notebooks, build the HTML book, print its path  (FORCE=1: from nothing)
	@$(PY) tools/build_book.py $(if $(FORCE),--force)

quick: setup  ## format, lint, types and the fast tests  (a few minutes; while you work)
	@$(PY) tools/run_checks.py format lint types && $(PY) tools/run_tests.py --quick

test: setup  ## pytest on the package and the book, nbval on the notebooks
	@$(PY) tools/run_tests.py

mutants: setup  ## break the package on purpose, a line at a time: does the test that should notice notice?
	@$(PY) tools/run_tests.py --mutants

check: setup  ## format, lint, types, doctests, stored notebooks, budgets
	@$(PY) tools/run_checks.py

format: setup  ## let ruff format the code, and strip pictures from the stored notebooks
	@$(PY) -m ruff format . && $(PY) -m ruff check --fix . && $(PY) tools/notebook_hook.py --write

notebooks: setup  ## execute notebooks and store their text outputs  (NB=notebooks/ppo.ipynb for some)
	@$(PY) tools/execute_notebooks.py $(NB)

pages: book  ## open every built page in headless Chromium, six in Firefox, and check them
	@tools/setup.sh --with-browsers
	$(PY) -m pytest -q -m pages -n 2 --dist loadscope tests/pages

lighthouse: book  ## how fast six pages come to a phone, by Lighthouse  (about five minutes, quiet machine)
	@tools/setup.sh --with-chromium
	@$(PY) tools/lighthouse.py

pdf: book  ## print the whole book into one PDF, _build/pdf/in-bounds.pdf
	@tools/setup.sh --with-chromium
	@$(PY) tools/print_book.py

slides: book  ## a deck of key statements and figures for each core chapter, in _build/slides
	@$(PY) tools/slides.py

serve: book  ## preview the built book on this machine  (PORT=8000)
	@echo "Serving on http://127.0.0.1:$(PORT)/ (Ctrl-C ends it)"
	$(PY) -m http.server --bind 127.0.0.1 --directory _build/html $(PORT)

lab: setup  ## open JupyterLab on the chapters without solutions, in lab/ (your changes stay)
	@$(PY) tools/student_copies.py lab
	@$(PY) -m jupyterlab --notebook-dir=lab $(if $(filter 0,$(shell id -u)),--allow-root)

bench: setup  ## measure speed beside peers (RLtools, SBX, CleanRL in peers/) and the physics floor  (about 25 min, quiet machine)
	@$(PY) -m benchmarks.run $(if $(wildcard peers/bin/python),$(foreach who,sbx cleanrl rltools,--python $(who)-ppo=peers/bin/python))

dist: book  ## zip the built book for reading offline
	@$(PY) tools/build_book.py --zip

clean:  ## remove everything built (keeps .venv)
	@rm -rf _build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .cache
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

distclean: clean  ## also remove .venv
	@rm -rf .venv
