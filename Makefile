# Everything a stranger needs, on a bare Debian with Python >= 3.11: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
BENCH ?= .venv-bench
PYTEST ?=
# a worker of the tests has a core of its own: threads of linear algebra take turns with the other worker's, and spin
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.PHONY: help demo test test-long check bench docs count clean

help:
	@echo "make demo    the main job on the virtual machine: record, fit, judge on unseen cycles, report"
	@echo "make test    the tests (installs what they need)"
	@echo "make test-long   the tests that take long, and 2,000 random NC programs"
	@echo "make check   format, lint, types, architecture"
	@echo "make bench   speed and accuracy beside the peers"
	@echo "make docs    the documentation, into docs/_build/html"
	@echo "make count   lines of code by room"
	@echo "make clean   take away what the other targets made"

demo: $(VENV)/.study
	$(BIN)/thermocomp demo --output demo --overwrite

test: $(VENV)/.dev
	scripts/system_packages.sh chromium clang gcc gcc-arm-none-eabi libc6-dev libclang-rt-dev libnewlib-arm-none-eabi linuxcnc-uspace \
		linuxcnc-uspace-dev mosquitto qemu-system-arm
	$(ONE_THREAD) $(BIN)/python -m pytest -n 2 --dist loadfile $(PYTEST)

test-long: $(VENV)/.dev
	scripts/system_packages.sh gcc libc6-dev linuxcnc-uspace mosquitto
	$(ONE_THREAD) HYPOTHESIS_PROFILE=thorough $(BIN)/python -m pytest -n 2 --dist loadfile -m long
	$(BIN)/python -m pytest -m hours -rP

check: $(VENV)/.dev
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports

# in an environment of its own: the peers want older libraries. Without R its peers are left out.
bench: $(BENCH)/.bench
	-scripts/system_packages.sh r-base-core r-cran-acepack r-cran-leaps
	$(BENCH)/bin/python benchmarks/run.py

docs: $(VENV)/.docs
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

count:
	$(PYTHON) scripts/count.py

clean:
	rm -rf $(VENV) $(BENCH) demo docs/_build docs/auto_examples docs/auto_papers docs/reference/generated .coverage .mypy_cache .ruff_cache .pytest_cache .hypothesis \
		src/thermocomp/models/kernels/__pycache__

$(VENV)/.study: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study]'
	@touch $@

$(VENV)/.dev: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study,live,onnx]' --group dev
	@touch $@ $(VENV)/.study

$(BENCH)/.bench: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(BENCH) --editable '.[study]' --group bench
	@touch $@

$(VENV)/.docs: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study,live]' --group docs
	@touch $@ $(VENV)/.study
