# Two commands on a fresh machine: `make demo` and `make test`. Each sets up .venv by itself: the
# demo installs what planning needs, the tests add the rest to the same environment.
VENV   ?= .venv
PYTHON ?= python3
BIN     = $(VENV)/bin
DEMO   ?= demo
# one more than there are processors: vehicles and clocks are waited for
TESTERS = $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')

.PHONY: demo test accept docs wheel wheel-installed pythons tables lint bench js clean
.DELETE_ON_ERROR:

# --no-compile: half of pip's time goes into bytecode, most of it for modules that are never imported
$(VENV)/.core: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e .
	touch $@

$(VENV)/.installed: $(VENV)/.core
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e '.[dev]'
	$(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true
	touch $@

# compile everything ahead: otherwise each of the parallel test processes compiles what it needs
KERNELS = $(shell grep -rl --include='*.py' 'compiled.kernel import' netsp) $(wildcard netsp/compiled/*.py)
$(VENV)/.warm: $(VENV)/.installed $(KERNELS)
	$(BIN)/netsp warm-up --quiet --jobs 2
	touch $@

# write bytecode for later processes, even where the shell sets PYTHONDONTWRITEBYTECODE: without it
# every command that a test starts compiles all its modules again
demo test: export PYTHONDONTWRITEBYTECODE =
demo: $(VENV)/.core
	mkdir -p $(DEMO)
	$(BIN)/netsp solve problems/wharf.json -o $(DEMO)/wharf-solution.json --plot $(DEMO)/wharf.png
	$(BIN)/netsp verify problems/wharf.json $(DEMO)/wharf-solution.json
	@echo
	@echo "The picture is $(DEMO)/wharf.png, the tour $(DEMO)/wharf-solution.json."

test: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	($(BIN)/mypy && $(BIN)/mypy --config-file benchmarks/mypy.ini) & types=$$!; $(MAKE) --no-print-directory $(VENV)/.warm && \
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(TESTERS) --dist worksteal --durations 20 && wait $$types

# the linter and type checker for the page's scripts, where there is npm; `make test` runs them then
js:
	npm ci --prefix tests/js --no-audit --no-fund --silent

# every figure of README and docs, measured on this commit
accept: $(VENV)/.warm
	$(BIN)/python benchmarks/accept.py

# the pages as a site, in build/site, checked before and after; a warning is an error
docs: $(VENV)/.installed
	$(BIN)/python docs/hooks/check_pages.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	$(BIN)/python docs/hooks/check_site.py build/site

# the wheel that a release would have, alone in a new environment, does the main job
wheel: wheel-installed
	cd build/wheel && env/bin/netsp --version
	cd build/wheel && env/bin/netsp solve ../../problems/pool.json -o tour.json --plot tour.png --proof tour.proof --quiet
	cd build/wheel && env/bin/netsp verify ../../problems/pool.json tour.json --proof tour.proof --quiet
	cd build/wheel && env/bin/python -m netsp_check ../../problems/pool.json tour.json tour.proof

wheel-installed: $(VENV)/.core
	rm -rf build/wheel && mkdir -p build/wheel
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps -w build/wheel .
	$(PYTHON) -m venv build/wheel/env
	build/wheel/env/bin/pip install --quiet --disable-pip-version-check build/wheel/netsp-*.whl

# the same under every other Python that we declare, that is here, and for which numba and the others are to be had
PYTHONS ?= 3.11 3.12 3.13
pythons:
	@own=$$($(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
	for version in $(PYTHONS); do \
		[ $$version = $$own ] && continue; \
		for python in python$$version $$HOME/.pyenv/versions/$$version.*/bin/python; do \
			$$python --version > /dev/null 2>&1 || continue; \
			echo "== $$($$python --version)"; \
			$(MAKE) --no-print-directory wheel-installed PYTHON=$$python 2> /dev/null || \
				{ echo "cannot be installed there: skipped"; break; }; \
			$(MAKE) --no-print-directory -o wheel-installed wheel PYTHON=$$python || exit 1; \
			break; \
		done; \
	done

# the tables of the docs, written from the rows that the benchmarks keep
tables: $(VENV)/.installed
	$(BIN)/python benchmarks/tables.py

lint: $(VENV)/.installed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/mypy
	$(BIN)/mypy --config-file benchmarks/mypy.ini

bench: $(VENV)/.installed
	$(BIN)/python benchmarks/spine.py

clean:
	rm -rf $(VENV) $(DEMO) .pytest_cache .mypy_cache .ruff_cache
