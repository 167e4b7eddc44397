# Each target sets up what it needs, in .venv and target: a machine with Python 3.11, a Rust toolchain and make is enough.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOG := target/test.log
SOURCES := Cargo.toml Cargo.lock pyproject.toml README.md $(shell find src python -type f -not -name '*.pyc')
# The optimised profile keeps the checks of a debug build.
CARGO_TEST := cargo test --locked --profile test-release

.PHONY: demo test lint rust instructions instructions-accept wheel python examples docs figures bench performance clean help

help:
	@echo "make demo    a generated route, mapped and localized along, with a report in out/demo"
	@echo "make test    every check: formatting, lints, Rust, the wheel, Python, examples, the demo"
	@echo "make docs    the documentation, in out/docs/index.html"
	@echo "make figures              the pictures of the documentation's pages, made anew"
	@echo "make bench   how fast it is here: in Rust, and from Python beside its rivals, which are installed for it"
	@echo "make performance          the tables of docs/performance.md, made anew"
	@echo "make instructions-accept  the instruction counts that make test guards, made anew"
	@echo "make wheel   the Python wheel, in dist"
	@echo "make clean   remove all that the targets made"

demo: $(VENV)/installed
	$(BIN)/surefix demo --out out/demo

test: lint rust instructions python examples docs
	$(BIN)/surefix demo --out out/demo
	$(BIN)/surefix bench --quick --out out/bench
	@echo; echo "== summaries"
	@grep -h '^test result' $(LOG).rust
	@tail -n 1 $(LOG).python

lint: $(VENV)/dev
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings
	cargo clippy --locked --no-default-features -- -D warnings
	$(BIN)/ruff check python tests benches examples docs/*.py docs/_ext
	$(BIN)/ruff format --check python tests benches examples docs/*.py docs/_ext

# The same tests on all cores and on one; then the examples in the documentation.
rust:
	@mkdir -p target
	$(CARGO_TEST) 2>&1 | tee $(LOG).rust; test $${PIPESTATUS[0]} -eq 0
	$(CARGO_TEST) --no-default-features --lib --tests 2>&1 | tee -a $(LOG).rust; test $${PIPESTATUS[0]} -eq 0
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps

# Against the installed wheel, never against the source folder.
python: $(VENV)/installed $(VENV)/dev
	@mkdir -p target
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest surefix._core
	$(BIN)/python -m pytest 2>&1 | tee $(LOG).python; test $${PIPESTATUS[0]} -eq 0

examples: $(VENV)/installed
	cargo run --locked --profile test-release --example stream
	$(BIN)/python examples/stream.py
	$(BIN)/python examples/batch.py

# Instructions of the hot kernels, under valgrind: none may rise by more than 2 %. Skipped, with a word, without valgrind.
instructions:
	$(PYTHON) benches/instructions.py

instructions-accept:
	$(PYTHON) benches/instructions.py --accept

# Of the installed wheel. A warning ends the build: a link into nowhere, a name without a page, a notebook that fails.
docs: $(VENV)/docs
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --fresh-env -d target/doctrees docs out/docs
	@echo "Made out/docs/index.html"

figures: $(VENV)/docs
	$(BIN)/python docs/pages.py

# Quickly, to see that it works: make bench QUICK=--quick
bench: $(VENV)/rivals
	cargo bench --locked -- $(QUICK)
	$(BIN)/surefix bench $(QUICK) --out out/bench
	$(BIN)/surefix bench latency

performance: $(VENV)/rivals
	$(BIN)/surefix bench --docs docs/performance.md

wheel: $(VENV)/wheel

$(VENV)/made:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "maturin>=1.16,<2"
	@touch $@

$(VENV)/wheel: $(VENV)/made $(SOURCES)
	@rm -rf dist
	$(BIN)/maturin build --release --locked --out dist
	@touch $@

$(VENV)/installed: $(VENV)/wheel
	$(BIN)/python -m pip install --quiet --force-reinstall --no-deps dist/*.whl
	$(BIN)/python -m pip install --quiet "$$(echo dist/*.whl)[plot]"
	@touch $@

# Rerun is as large as all the rest: `dev` leaves it out, and the checks do not.
$(VENV)/dev: $(VENV)/installed
	$(BIN)/python -m pip install --quiet "$$(echo dist/*.whl)[dev,live]"
	@touch $@

$(VENV)/docs: $(VENV)/installed
	$(BIN)/python -m pip install --quiet "$$(echo dist/*.whl)[docs]"
	@touch $@

$(VENV)/rivals: $(VENV)/installed
	$(BIN)/python -m pip install --quiet "$$(echo dist/*.whl)[bench]"
	@touch $@

clean:
	rm -rf $(VENV) target dist out

SHELL := /bin/bash
