# All that is needed on a bare Debian with Python >= 3.11: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
BENCH ?= .venv-bench
PYTEST ?=
# each test worker uses one core: more threads of linear algebra would compete with the others
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.PHONY: help demo test test-long check mutants bench docs verdicts count clean

help:
	@echo "make demo    the main workflow on the virtual machine: record, fit, evaluate on unseen cycles, report"
	@echo "make test    the tests (installs what they need)"
	@echo "make test-long   the long-running tests, and 2,000 random NC programs"
	@echo "make check   format, lint, types, architecture"
	@echo "make mutants change the code of each requirement of the papers, one place at a time: a test has to fail"
	@echo "make bench   speed and accuracy compared with other packages"
	@echo "make docs    the documentation, into docs/_build/html"
	@echo "make verdicts    the papers' studies again, and their tables in the documentation"
	@echo "make count   lines of code by package"
	@echo "make clean   remove everything that the other targets created"

demo: $(VENV)/.study
	$(BIN)/thermocomp demo --output demo --overwrite

test: $(VENV)/.dev
	scripts/system_packages.sh chromium clang gcc gcc-arm-none-eabi libc6-dev libclang-rt-dev libnewlib-arm-none-eabi linuxcnc-uspace \
		linuxcnc-uspace-dev mosquitto qemu-system-arm
	$(ONE_THREAD) $(BIN)/python $(UNDER) -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(PYTEST)

test-long: $(VENV)/.dev
	scripts/system_packages.sh gcc libc6-dev linuxcnc-uspace mosquitto
	$(ONE_THREAD) HYPOTHESIS_PROFILE=thorough $(BIN)/python -m pytest -n 2 --dist loadfile -m long
	$(BIN)/python -m pytest -m hours -rP

check: $(VENV)/.dev
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/lint-imports

# of the requirements whose code or tests have changed; MUTANTS="--all", or ids such as "C-15 H"
mutants: $(VENV)/.dev
	PYTHONPATH=tools $(BIN)/python -m mutants $(MUTANTS)

# in a separate environment: the other packages require older libraries. Without R its packages are omitted.
bench: $(BENCH)/.bench
	-scripts/system_packages.sh gcc linuxcnc-uspace mosquitto r-base-core r-cran-acepack r-cran-leaps valgrind
	$(BENCH)/bin/python benchmarks/run.py

# DOCS="-D plot_gallery=0" leaves out what takes longest: the examples and the papers' studies are not executed
docs: $(VENV)/.docs
	$(BIN)/sphinx-build -W --keep-going $(DOCS) -b html docs docs/_build/html

verdicts: $(VENV)/.study
	$(ONE_THREAD) $(BIN)/python scripts/verdicts.py $(STUDIES)

count:
	$(PYTHON) scripts/count.py

clean:
	rm -rf $(VENV) $(BENCH) demo docs/_build docs/auto_examples docs/auto_papers docs/reference/generated .coverage .mypy_cache .ruff_cache .pytest_cache .hypothesis \
		src/thermocomp/models/kernels/__pycache__

$(VENV)/.study: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study]'
	@touch $@

$(VENV)/.dev: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study,live,onnx,files]' --group dev
	@touch $@ $(VENV)/.study

$(BENCH)/.bench: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(BENCH) --editable '.[study,live]' --group bench
	@touch $@

$(VENV)/.docs: pyproject.toml
	scripts/make_venv.sh $(PYTHON) $(VENV) --editable '.[study,live]' --group docs
	@touch $@ $(VENV)/.study
