# `make demo` and `make test` need nothing but Python 3.11 or 3.12, for which ROS 2 Jazzy exists: each makes its own
# environment in .venv first, unless it is there. `make PYTHON=python3.12 ...` names another Python.
VENV ?= .venv
# one more than the cores: tests over DDS wait for a third of their time
JOBS ?= 3
SUITABLE := import ensurepip, sys, venv; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))
ifndef PYTHON
FOUND := $(shell for p in $(VENV)/bin/python python3 python3.12 python3.11; do $$p -c '$(SUITABLE)' 2>/dev/null && echo $$p && break; done)
PYTHON := $(or $(FOUND),python3)
endif

PYTHON_VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
READY := $(VENV)/ready-$(PYTHON_VERSION)
TESTS_READY := $(READY)-with-tests
BIN := $(VENV)/bin

# What a sourced ROS 2 or another environment exports would be mixed with the packages in .venv.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport LD_LIBRARY_PATH
endif
unexport AMENT_PREFIX_PATH PYTHONPATH PYTHONHOME RMW_IMPLEMENTATION VIRTUAL_ENV _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Nothing is compiled at installation: where bytecode is not kept, each of the many processes compiles all it imports.
unexport PYTHONDONTWRITEBYTECODE
# as in the package's own processes: small matrices take twice as long on two threads
export OMP_NUM_THREADS ?= 1

.PHONY: demo test quick-tests test-long test-release lint kernels bench clean

demo: $(READY)
	$(BIN)/swath-sysid demo --output out/

# mypy takes one core for half a minute: beside the kernels, and where these are there, beside the first tests
test: $(TESTS_READY)
	@$(MAKE) --no-print-directory --jobs 2 lint quick-tests

quick-tests: kernels
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --durations 30 -m 'not long and not release'

# the longest files first: begun last, they would be waited for
test-long: $(TESTS_READY)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --durations 30 -m 'long and not release' test/test_docs_*.py test/test_wings.py \
	  $$(grep -rl --include='test_*.py' mark.long test | sort)

# what is measured over many draws, before a release
test-release: $(TESTS_READY)
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --durations 30 -m release

lint: $(TESTS_READY)
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

# Once: otherwise each of the processes that test would compile them for itself.
kernels: $(READY)
	@$(BIN)/swath-sysid compile --quiet

# An exit code of 2 says that a library which only this benchmark needs is not installed.
bench: $(READY)
	@for script in $$(grep -l __main__ benchmark/*.py); do \
	  echo "== $$script"; $(BIN)/python $$script || [ $$? -eq 2 ] || exit 1; done

clean:
	rm -rf $(VENV) build install log dist out *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# $(EXTRAS) into $(VENV), which is made first where it is not there
define INSTALL
	@$(PYTHON) -c '$(SUITABLE)' 2>/dev/null \
	  || { echo '$(PYTHON) is not Python 3.11 or 3.12 with its venv module: install one (apt install python3-venv),' \
	    'or name it (make PYTHON=python3.12)' >&2; exit 1; }
	@echo 'Setting up $(VENV) with Python $(PYTHON_VERSION): once, half a minute to a minute'
	@rm -f $(VENV)/ready-*
	@test -x $(BIN)/python$(PYTHON_VERSION) || $(PYTHON) -m venv --clear $(VENV)
	@# what nothing imports need not be compiled: half of the processor time
	@$(BIN)/python -m pip install -qq --no-compile --editable '.[$(EXTRAS)]'
	@touch $(READY) $@
endef

$(READY): EXTRAS = ros,fast
$(READY): setup.py package.xml
	$(INSTALL)

# in one go where nothing is there yet
$(TESTS_READY): EXTRAS = ros,fast,test
$(TESTS_READY): setup.py package.xml
	$(INSTALL)
