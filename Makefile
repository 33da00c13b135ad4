# make setup | demo | test | lint | format | fuzz | bench | freeze | clean
# Without make (Windows): see README.md.

SHELL := /bin/sh
VENV := .venv
BENCH_VENV := .venv-bench
BIN := $(VENV)/bin
STAMP := $(VENV)/.setup-done
BENCH_STAMP := $(BENCH_VENV)/.setup-done
PIP_INSTALL := -m pip install --quiet --no-input --disable-pip-version-check
PYTEST_ARGS ?=
MINUTES ?= 10
KILLS ?= 20
OUT ?= out/demo

# An interpreter of your choice: make setup PYTHON=python3.12
PYTHON ?=
CANDIDATES := $(if $(PYTHON),$(PYTHON),python3 python3.13 python3.12 python3.11 python)

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint format fuzz bench freeze clean
.DELETE_ON_ERROR:

help:
	@echo "make setup    everything into $(VENV)"
	@echo "make demo     the whole loop, simulated and on a real capture, results in $(OUT)"
	@echo "make test     all tests (PYTEST_ARGS='-k gray' to choose)"
	@echo "make lint     ruff, mypy --strict, import-linter"
	@echo "make format   let ruff rewrite"
	@echo "make fuzz     spoilt files, $(MINUTES) minutes for each reader, then killed commands (MINUTES=1 KILLS=3)"
	@echo "make bench    speed and accuracy beside the peers, in $(BENCH_VENV)"
	@echo "make freeze   print the versions in $(VENV), for constraints.txt"
	@echo "make clean    remove both environments and all caches"

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(call make_venv,$(VENV))
	@echo "setup: installing fringeworks and its tools into $(VENV) (the first time takes minutes)"
	@$(BIN)/python $(PIP_INSTALL) -c constraints.txt -e '.[dev,mesh,register,e57,hardware]'
	@if pkg-config --exists gobject-introspection-1.0 cairo gio-2.0 2>/dev/null; then \
		$(BIN)/python $(PIP_INSTALL) -c constraints.txt -e '.[aravis]' || \
			echo "setup: PyGObject was not built, so no Aravis cameras (docs/devices.md)"; \
	fi
	@touch $@
	@echo "setup: done, try $(BIN)/fringeworks --help"

demo: setup
	$(BIN)/fringeworks demo --out $(OUT)

test: setup
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile $(PYTEST_ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

fuzz: setup
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES)
	$(BIN)/python -m tests.fuzz --kills $(KILLS)

bench: $(BENCH_STAMP)
	$(BENCH_VENV)/bin/fringeworks bench

# The peers need OpenCV's contrib build, which cannot live beside the plain one: so an environment
# of its own, with fringes and fringeworks installed without what they would pull in.
$(BENCH_STAMP): pyproject.toml constraints.txt
	@$(call make_venv,$(BENCH_VENV))
	@echo "bench: installing the peers into $(BENCH_VENV) (the first time takes minutes)"
	@$(BENCH_VENV)/bin/python -c "$$LIST_BENCH_NEEDS" > $(BENCH_VENV)/needs.txt
	@$(BENCH_VENV)/bin/python $(PIP_INSTALL) -c constraints.txt -r $(BENCH_VENV)/needs.txt
	@$(BENCH_VENV)/bin/python -c "$$LIST_BENCH_PEERS" > $(BENCH_VENV)/peers.txt
	@$(BENCH_VENV)/bin/python $(PIP_INSTALL) --no-deps -r $(BENCH_VENV)/peers.txt -e .
	@touch $@

freeze: setup
	@$(BIN)/python -m pip freeze --exclude-editable --disable-pip-version-check

clean:
	rm -rf $(VENV) $(BENCH_VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# make_venv,FOLDER: keep a working environment of a fitting Python, else make it anew.
define make_venv
venv=$(1); fits='import sys, pip; sys.exit(not (3, 11) <= sys.version_info < (3, 14))'; \
if [ -x $$venv/bin/python ] && $$venv/bin/python -c "$$fits" 2>/dev/null; then exit 0; fi; \
python=; \
for candidate in $(CANDIDATES); do \
    if $$candidate -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; \
    then python=$$candidate; break; fi; \
done; \
if [ -z "$$python" ]; then \
    echo "setup: fringeworks needs Python 3.11, 3.12 or 3.13; tried: $(CANDIDATES)" >&2; \
    echo "setup: install one, or name it: make setup PYTHON=/path/to/python3.12" >&2; \
    exit 1; \
fi; \
if ! $$python -c 'import ensurepip, venv' 2>/dev/null; then \
    echo "setup: this Python cannot make environments (no ensurepip): apt install python3-venv" >&2; \
    exit 1; \
fi; \
echo "setup: making $$venv with $$($$python --version)"; \
$$python -m venv --clear $$venv
endef

define LIST_BENCH_NEEDS
import tomllib
project = tomllib.load(open('pyproject.toml', 'rb'))['project']
peers = project['optional-dependencies']['bench']
needs = project['dependencies'] + [p for p in peers if not p.startswith('fringes')]
print('\n'.join(n for n in needs if not n.startswith('opencv-python-headless')))
endef
export LIST_BENCH_NEEDS

define LIST_BENCH_PEERS
import tomllib
peers = tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['bench']
print('\n'.join(p for p in peers if p.startswith('fringes')))
endef
export LIST_BENCH_PEERS
