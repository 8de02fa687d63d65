# The same commands on a developer's machine and in CI. One virtual environment (.venv) with
# stamps: .serve holds what the service needs, .lab adds training, evaluation and load tools, .dev tests
# and the Python client; .client and .engines (exports for pages and game engines) are parts of them.
# Versions are those of requirements/, which `make lock` renews.
#
# Knobs:  make serve ARGS="--http-port 9000"     options of `wayfarer serve`
#         make test  ARGS="-k goals -x"          options of pytest; -n 0: all in one process
#         make PYTHON=/path/to/python3.12 serve  another interpreter (3.11 or newer)

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?=
ARGS ?=

PACKAGE := pyproject.toml proto/build_hook.py proto/schema_classes.py $(shell find proto -name '*.proto')
CLIENT := clients/python/pyproject.toml clients/python/build_hook.py
WEB := clients/web
NPM_TOOLS := tests/node_modules/.package-lock.json
BUF := tests/node_modules/.bin/buf
RELEASED := tests/proto/released.binpb
CHECKED := service lab tests requirements clients/python benchmarks $(wildcard proto/*.py) .github/name_repository.py
PINNED := requirements/build.txt requirements/serve.txt
PINS := $(CURDIR)/requirements/dev.txt

export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_ROOT_USER_ACTION := ignore
# Python compiles what it imports; pip would compile all of torch. PIP_NO_COMPILE=1 means the opposite.
export PIP_COMPILE := 0

.PHONY: help serve lab demo test lint lint-proto release-proto format proto lock matrix docker
.PHONY: image-check clean

help: ## show this list
	@echo "Wayfarer. Usage: make <target>"
	@sed -nE 's/^([a-z-]+):.*## (.*)/  \1\t\2/p' Makefile | expand -t 16

serve: $(VENV)/.serve ## set up and start the server with the shipped models: gRPC 50051, HTTP and viewer 8080
	@exec $(BIN)/wayfarer serve $(ARGS)

lab: $(VENV)/.lab ## set up training, evaluation, data preparation and load tools (torch)

demo: $(VENV)/.engines $(WEB)/node_modules/.package-lock.json ## write a static page in which people walk without a server (build/demo)
	@$(BIN)/python -m wayfarer_lab.demo $(or $(ARGS),build/demo)

test: $(VENV)/.dev ## set up and run all tests
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory $(WEB)/node_modules/.package-lock.json $(NPM_TOOLS); \
	else echo "skipped: clients/web and the glTF validator need npm (apt-get install npm)" >&2; [ -z "$${CI:-}" ]; fi
	@if ! { command -v cmake && command -v clang++ && test -e /usr/include/boost/beast.hpp; } >/dev/null; then \
	echo "skipped: clients/cpp and clients/unreal need compilers and libraries (.ci/run lists them)" >&2; [ -z "$${CI:-}" ]; fi
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder $(ARGS)

lint: $(VENV)/.dev ## check style, types, the import rules and the protos
	$(BIN)/ruff check $(CHECKED)
	$(BIN)/ruff format --check $(CHECKED)
	$(BIN)/mypy
	$(BIN)/lint-imports
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory lint-proto; \
	else echo "skipped: buf needs npm (apt-get install npm)" >&2; [ -z "$${CI:-}" ]; fi

lint-proto: $(NPM_TOOLS) ## check the protos: style, and compatibility with the last release
	@$(BUF) lint proto
	@$(BUF) breaking proto --against $(RELEASED) || { echo "proto/ breaks what the last release" \
	  "promised ($(RELEASED)): see CONTRIBUTING.md" >&2; exit 1; }

release-proto: $(NPM_TOOLS) ## at a release: make the present protos the reference of lint-proto
	@$(BUF) build proto --exclude-source-info -o $(RELEASED)

format: $(VENV)/.dev ## format the code
	$(BIN)/ruff check --fix $(CHECKED)
	$(BIN)/ruff format $(CHECKED)

proto: $(VENV)/.serve ## generate the Python code of proto/
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable . --editable clients/python

lock: | $(BIN)/python ## pin the newest versions that pyproject.toml allows in requirements/
	@$(BIN)/python requirements/renew.py $(ARGS)

matrix: | $(BIN)/python ## test pinned and newest dependencies with every Python here; an agent walks in each
	@$(BIN)/python -m tests.installed.matrix $(ARGS)

docker: ## build the image wayfarer:latest
	docker build --tag wayfarer .

image-check: $(VENV)/.client ## build and run the image; an agent walks in it (docker, or buildah)
	@$(BIN)/python -m tests.installed.image $(ARGS)

clean: ## remove the virtual environment, generated code and caches
	rm -rf $(VENV) build dist service/wayfarer/v1 service/wayfarer/transport/schema/messages.py clients/python/wayfarer_client/v1
	rm -rf $(WEB)/node_modules $(WEB)/types tests/node_modules
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find service lab clients tests -name __pycache__ -type d -prune -exec rm -rf {} +

# What the web client's tests need: engines, types.
$(WEB)/node_modules/.package-lock.json: $(WEB)/package-lock.json
	@cd $(WEB) && npm ci --silent --ignore-scripts && touch node_modules/.package-lock.json

# What tests and `make lint` take from npm.
$(NPM_TOOLS): tests/package.json
	@cd tests && npm install --silent --ignore-scripts --no-package-lock && touch ../$@

# The first interpreter that is new enough and can make virtual environments (Debian splits that off).
$(BIN)/python:
	@for python in $(if $(PYTHON),$(PYTHON),python3 python3.14 python3.13 python3.12 python3.11); do \
	  if "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	    echo "setting up $(VENV) with $$("$$python" --version)"; \
	    "$$python" -m venv --clear $(VENV); exit; \
	  fi; \
	done; \
	echo "Wayfarer needs Python 3.11 or newer with the venv module, and found none." >&2; \
	echo "On Debian 12+ or Ubuntu 24.04+:  sudo apt-get install python3 python3-venv" >&2; \
	echo "Elsewhere, name an interpreter:  make $(MAKECMDGOALS) PYTHON=/path/to/python3.12" >&2; \
	exit 1

$(VENV)/.serve: $(PACKAGE) $(PINNED) | $(BIN)/python
	@echo "installing the service into $(VENV) (once; about half a minute)"
	@$(BIN)/pip install --quiet --no-deps --require-hashes $(PINNED:%=--requirement %)
	@$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	@$(BIN)/python -m wayfarer.transport.prepare
	@touch $@

# What builds these packages is there with .serve.
$(VENV)/.client $(VENV)/.engines $(VENV)/.lab $(VENV)/.dev: export PIP_CONSTRAINT = $(PINS)

$(VENV)/.client: $(VENV)/.serve $(PINS) $(CLIENT)
	@$(BIN)/pip install --quiet --no-build-isolation --editable clients/python
	@touch $@

$(VENV)/.engines: $(VENV)/.serve $(PINS) lab/pyproject.toml
	@echo "installing what exports models into $(VENV) (once; without torch)"
	@$(BIN)/pip install --quiet --no-build-isolation --editable './lab[engines]'
	@touch $@

$(VENV)/.lab: $(VENV)/.serve $(PINS) lab/pyproject.toml
	@echo "installing torch and the tools of lab/ into $(VENV) (once)"
	@$(BIN)/pip install --quiet --no-build-isolation --editable './lab[train,render,load]'
	@touch $@

$(VENV)/.dev: $(VENV)/.lab $(VENV)/.client
	@echo "installing the test tools into $(VENV) (once)"
	@$(BIN)/pip install --quiet --no-build-isolation --editable '.[dev]'
	@touch $@
