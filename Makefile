# Everything a person does with this repository. `make help` lists the targets.
PYTHON ?= $(firstword $(foreach p,python3.11 python3.12 python3.13 python3,$(shell command -v $(p))))
VENV := .venv
BIN := $(VENV)/bin
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python

.DEFAULT_GOAL := help
.PHONY: help setup build demo test test-rust test-python lint fmt bench compare schema blender gallery validation stability docs pictures kills clean

help: ## List the targets
	@awk 'BEGIN {FS = ":.*## "} /^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/.ready ## System packages (as root), virtual environment and pinned Python packages

$(VENV)/.ready: python/requirements.txt tools/setup.sh
	bash tools/setup.sh "$(PYTHON)" "$(VENV)"
	@touch $@

build: setup ## Compile the engine (release) and install `clothsim` into the virtual environment
	$(BIN)/maturin develop --release --locked

demo: build ## Run the main job: a tablecloth falls on a sphere, drapes and is turned; results in out/demo
	$(BIN)/clothsim run examples/drape.toml -o out/demo --overwrite

test: test-rust test-python ## All tests, Rust and Python

# Cargo turns on a dependency's features by what the crates selected on the command line ask for. This selection asks for
# those of the Python extension, which maturin builds alone, so that both share every compiled crate. Benches have no tests.
test-rust: setup ## Unit, oracle and physics tests of the Rust crates, doc tests included
	cargo test --release --locked --workspace --exclude cloth-benches

test-python: build ## Behavioural tests through the Python package and the command line
	$(BIN)/pytest

lint: build ## Formatting, clippy, crate arrows, ruff, mypy, stubs: clean or failing
	cargo fmt --all --check
	cargo clippy --release --locked --workspace --all-targets -- -D warnings
	cargo clippy --release --locked -p cloth-sim -p cloth-py --no-default-features --all-targets -- -D warnings
	$(BIN)/python tools/check_arrows.py
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/stubtest clothsim._core

fmt: setup ## Format all sources
	cargo fmt --all
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup ## Criterion benches of every kernel and scene (minutes); one of them: cargo bench --bench NAME
	cargo bench --locked -p cloth-benches

compare: build ## Detection side by side with IPC Toolkit, in one run (installs it into the environment)
	$(BIN)/pip install --quiet "ipctk==1.6.1"
	$(BIN)/python benches/compare_ipctk.py

docs: build ## The documentation site, strictly, into out/site (open out/site/index.html)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

pictures: build ## Draw the pictures of the effects again (two minutes): docs/images/effects
	$(BIN)/python tools/pages/pictures.py

schema: build ## Write the JSON schema of scene files to docs/scene.schema.json
	$(BIN)/clothsim schema > docs/scene.schema.json

gallery: build ## Make all studies of the gallery again (five minutes on two idle cores; only there times count)
	$(BIN)/python tools/gallery.py

# Blender has NumPy 1 and weighs 0.9 GB installed: an environment of its own.
blender: build ## Import what we write into headless Blender and compare every vertex (downloads 0.4 GB, Python 3.11)
	[ -x .venv-blender/bin/python ] || $(PYTHON) -m venv .venv-blender
	.venv-blender/bin/python -m pip install --quiet --disable-pip-version-check "bpy==4.5.15"
	$(BIN)/python tools/blender/write.py out/blender
	.venv-blender/bin/python tools/blender/check.py out/blender

validation: build ## Compare with exact solutions and measured fabrics (minutes); writes validation/*.csv, *.png
	$(BIN)/python -m validation

stability: build ## Run the stability atlas, every case over its whole map (minutes); writes stability/
	$(BIN)/clothsim stability -o stability --overwrite

kills: build ## Kill a run 100 times and a sweep's workers 16 times at random (a quarter of an hour); compare every byte
	$(BIN)/python tools/kills.py --kills 100
	$(BIN)/python tools/lost_workers.py --runs 64 --kills 16

clean: ## Remove what the targets above made
	rm -rf target $(VENV) .venv-blender out
