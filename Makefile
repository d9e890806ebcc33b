# The two commands: `make demo` and `make test`. Each sets up what it needs.
SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
OUT := out
# How many processes share the tests: three for each processor, because a test waits for two thirds of its time. Two of
# them run the load tests, which measure: all others, linters included, leave the processor to these.
WORKERS ?= $(shell echo $$((3 * $$(nproc))))
LATER := nice -n 10
# The newest Python that is there, from 3.11 up; or say which: make PYTHON=/path/to/python3.12 install
PYTHON ?= $(shell for p in python3.13 python3.12 python3.11 python3; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null && command -v $$p && break; done)
INTERFACES := $(addprefix reference_robot/interfaces/,mybot_delivery_app nav2_msgs tf2_msgs)
INTERFACE_FILES := $(sort $(shell find reference_robot/interfaces -type f -not -path '*/build/*'))
# What `make demo` needs; the tools for tests and lint come with the others.
DEMO := '.[load,robot,ros]'
DEV := '.[load,robot,ros,dev]'
# uv installs in seconds what takes pip minutes. It is used where it is there or can be had, and pip where it fails.
# Modules are compiled when they are installed, as pip does: else each run does it where Python may write no cache.
UV = $(shell command -v uv || command -v $(BIN)/uv)
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
installed = $(if $(UV),$(UV) pip install --quiet --compile-bytecode --python $(BIN)/python $(1) ||) $(PIP) install $(1)
built = $(if $(UV),$(UV) build --quiet --wheel --python $(BIN)/python --out-dir $(2) $(1) ||) $(PIP) wheel --no-deps --wheel-dir $(2) $(1)
# The wheels of the interface packages, for all clones: by their sources and the Python that they are for.
WHEELS = $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/roaas/interfaces/$(shell { sha256sum $(INTERFACE_FILES); \
	$(BIN)/python -c 'import sysconfig; print(sysconfig.get_config_var("SOABI"))'; } | sha256sum | cut -c -16)

.PHONY: help install demo test lint docs screenshots selftest coverage-page bench clean

help:
	@echo "make demo      set up, start the robot, certify it, measure it, leave the reports in $(OUT)/"
	@echo "make test      set up, then lint, types and all tests"
	@echo "make install   set up only: $(VENV) with the command roaas in it, and the tools for tests"
	@echo "make docs      build the documentation site: build/site/index.html"
	@echo "make selftest  show that the suite kills mutants and has no false positives (about half an hour)"
	@echo "make bench     print the benchmarks' ratios"
	@echo "make clean     remove what the others made, except for the interface packages in the user's cache"

install: $(VENV)/.installed

# What pip cannot bring has to be there: each thing is named that is not.
.PHONY: prerequisites
prerequisites:
	@test -n "$(PYTHON)" || { echo "missing: Python 3.11 to 3.14 (Debian, Ubuntu: apt install python3 python3-venv)" >&2; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "missing: the venv module of $(PYTHON) (Debian, Ubuntu: apt install python3-venv)" >&2; exit 2; }
	@$(PYTHON) -c 'import sysconfig, pathlib, sys; sys.exit(not pathlib.Path(sysconfig.get_path("include"), "Python.h").exists())' || \
		{ echo "missing: the headers of $(PYTHON), to build the ROS interfaces (Debian, Ubuntu: apt install python3-dev)" >&2; exit 2; }
	@command -v c++ >/dev/null || \
		{ echo "missing: a C++ compiler, to build the ROS interfaces (Debian, Ubuntu: apt install g++)" >&2; exit 2; }
	@test "$$(uname -sm)" = "Linux x86_64" || \
		{ echo "the robot runs on Linux x86-64 only (ROS 2 from PyPI); the suite alone runs anywhere: pip install '.[all]'" >&2; exit 2; }

$(VENV)/.made: | prerequisites
	@echo "== making $(VENV) with $(PYTHON)"
	@$(PYTHON) -m venv $(VENV)
	@test -n "$(UV)" || $(PIP) install uv || echo "without uv, the next steps take about three minutes"
	@touch $@

$(VENV)/.demo: pyproject.toml constraints.txt $(INTERFACE_FILES) | $(VENV)/.made
	@echo "== installing what the demo needs"
	@$(call installed,--constraint constraints.txt --editable $(DEMO))
	@wheels='$(WHEELS)'; test -d "$$wheels" || { \
		echo "== building the ROS 2 interface packages, which stay in $$wheels"; mkdir -p "$${wheels%/*}"; \
		printf '%s\n' $(INTERFACES) | xargs -P 3 -I {} bash -c "$(call built,./{},'$$wheels.$$$$')" && mv -T "$$wheels.$$$$" "$$wheels"; }
	@$(call installed,--no-deps --force-reinstall '$(WHEELS)'/*.whl)
	@$(BIN)/python -m compileall -q conformance loadtests reference_robot reports ros_probe proof roaas.py roaas_pytest.py
	@touch $@

$(VENV)/.installed: $(VENV)/.demo
	@echo "== installing the tools for tests and lint"
	@$(call installed,--constraint constraints.txt --editable $(DEV))
	@touch $@

demo: $(VENV)/.demo
	$(BIN)/python demo.py --out $(OUT)

# Style and types are checked beside the tests, which wait for half of their time.
test: install browser servers
	@$(MAKE) --no-print-directory --jobs=3 style types tests

lint: style types

.PHONY: style types tests
style: install
	$(LATER) $(BIN)/ruff check .
	$(LATER) $(BIN)/ruff format --check .

types: install
	$(LATER) $(BIN)/mypy

# The order of the modules is that of tests/conftest.py. Asserts are rewritten once, and not by each process in each run.
tests: install
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder --durations=30

# Fails on each warning, a broken link or anchor, and a page that would load something from another host.
docs: $(VENV)/.docs
	$(BIN)/python docs/site/build.py

$(VENV)/.docs: $(VENV)/.installed
	@$(call installed,--constraint constraints.txt --editable '.[docs]')
	@touch $@

# The pictures of README and docs, from the results of `make demo`.
screenshots: install browser
	$(BIN)/python docs/site/screenshots.py $(OUT)

# The report tests look at the pages in a real browser.
.PHONY: browser
browser:
	@command -v chromium chromium-browser google-chrome >/dev/null || \
		{ test "$$(id -u)" = 0 && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq chromium >/dev/null; } || \
		{ echo "missing: chromium, in which the report tests look at the pages (Debian, Ubuntu: apt install chromium)" >&2; exit 2; }

# Of the servers that the self-test knows, the two whose tests are quick; roaas selftest says which others are missing.
.PHONY: servers
servers:
	@PATH="$$PATH:/usr/sbin"; for server in nginx node; do command -v $$server >/dev/null || missing="$$missing $$server"; done; \
	missing="$${missing/node/nodejs}"; test -z "$$missing" || \
		{ test "$$(id -u)" = 0 && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq --no-install-recommends $$missing >/dev/null; } || \
		{ echo "missing:$$missing, web servers of the self-test (Debian, Ubuntu: apt install$$missing)" >&2; exit 2; }

selftest: install
	$(BIN)/roaas selftest --out $(OUT)/selftest

coverage-page: install
	$(BIN)/roaas contract coverage --out docs/coverage.md

bench: install
	$(BIN)/python benchmarks/robot.py
	$(BIN)/python benchmarks/generator.py

clean:
	rm -rf $(VENV) $(OUT) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
