# make install   .venv with the locked versions, and flexviz in it
# make serve     the app on bundled data   (ARGS="SET --port 9000" for something else)
# make test      style, types, tests
# make slow      the long tests, which `make test` leaves out; half an hour
# make coverage  all tests again, with the share of the code that they run
# make docs      the documentation as a static site in build/docs, its links checked
# make lock      write requirements.lock anew from pyproject.toml

PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo "$$p"; break; }; done)
BIN := .venv/bin
# of the tests: on two cores a third one works while the others wait for a browser
JOBS ?= 3

.PHONY: install serve test slow lint types pytest coverage browser format wheel docs lock clean
.DELETE_ON_ERROR:

install: $(BIN)/.installed

$(BIN)/.locked: requirements.lock
	@test -n "$(PYTHON)" || { echo "flexviz needs Python 3.11 or newer, and none was found:" \
	  "install it, or say where it is: make $(MAKECMDGOALS) PYTHON=/path/to/python3.11" >&2; exit 2; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "$(PYTHON) is" \
	  "$$("$(PYTHON)" --version 2>&1); flexviz needs Python 3.11 or newer" >&2; exit 2; }
	@test -x $(BIN)/pip || "$(PYTHON)" -m venv --clear .venv || { rm -rf .venv; echo "$(PYTHON) cannot make a" \
	  "virtual environment: install its venv module (Debian, Ubuntu: apt install python3-venv)" >&2; exit 2; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@touch $@

$(BIN)/.installed: $(BIN)/.locked pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	$(BIN)/python -m compileall -q flexviz  # commands start sooner, also where Python may not write bytecode
	@touch $@

serve: install
	$(BIN)/flexviz serve $(ARGS) || test $$? -eq 130  # Ctrl+C ends it

# types take a minute and a half of one core: beside the tests, told after them
test: lint browser
	@mkdir -p build; nice $(BIN)/pyright --pythonpath $(BIN)/python >build/types.txt 2>&1 & types=$$!; \
	  trap 'kill $$types 2>/dev/null' INT TERM; $(MAKE) --no-print-directory pytest; tests=$$?; wait $$types; types=$$?; \
	  echo "$(BIN)/pyright"; cat build/types.txt; exit $$((tests ? tests : types))

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/pyright --pythonpath $(BIN)/python

# the first command compiles the tests: once, and not in each worker
pytest: install browser
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest --collect-only -q $(ARGS) >/dev/null 2>&1 || true
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(ARGS)

slow: install browser
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m slow $(ARGS)

coverage: install browser
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m "slow or not slow" --cov --cov-report=term $(ARGS)

browser: install
	@sh tests/browser/install_chromium.sh $(BIN)/python

format: install
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

wheel: install
	$(BIN)/python -m hatchling build --target wheel

docs: install
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet
	@echo "build/docs/index.html"

# needs uv; versions and hashes only, no addresses
lock:
	uv pip compile pyproject.toml --group dev --all-extras --universal --python-version 3.11 --fork-strategy fewest \
	  --generate-hashes --no-strip-extras --no-emit-index-url --no-emit-find-links --no-annotate --no-header --quiet \
	  --output-file requirements.lock

clean:
	rm -rf .venv build dist .pytest_cache .ruff_cache .hypothesis .coverage
