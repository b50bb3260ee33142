# Terrawall: `make demo` shows it, `make test` proves it. `make help` lists the rest.
# Everything is built in the release profile, so that demo, tests and benches share one build.

SHELL       := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

TERRAWALL := $(or $(CARGO_TARGET_DIR),target)/release/terrawall
SOURCES   := tests/data
DATA      := out/data
# What decides the bytes of a repository: when it changes, the data is imported anew.
IMPORTER  := $(wildcard node/import/src/*.rs node/import/src/*/*.rs node/tiles/src/*.rs protocol/geodesy/src/*.rs)

.PHONY: help setup build data demo picture test bench lint clean

help: ## lists these targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' Makefile

setup: ## installs a software Vulkan driver where there is none (root), or says how
	@.ci/setup

build: ## builds the terrawall command
	cargo build --release --workspace --locked

data: build $(DATA)/.elevation $(DATA)/.imagery ## imports the embedded data into out/data

# `build` comes first, but must not make the data look old.
$(DATA)/.elevation: $(SOURCES)/etopo5.tif $(SOURCES)/N45E006.zip $(IMPORTER) | build
	rm -rf $(DATA)/elevation
	$(TERRAWALL) import $(SOURCES)/etopo5.tif --into $(DATA)/elevation --kind elevation
	$(TERRAWALL) import $(SOURCES)/N45E006.zip --into $(DATA)/elevation --kind elevation
	@touch $@

$(DATA)/.imagery: $(SOURCES)/bmng.jpg $(IMPORTER) | build
	rm -rf $(DATA)/imagery
	$(TERRAWALL) import $(SOURCES)/bmng.jpg --into $(DATA)/imagery --kind imagery --extent=-180,-90,180,90
	@touch $@

demo: setup data ## flies over the Earth on a wall of four nodes and leaves a picture and a report
	@rm -rf out/demo
	$(TERRAWALL) up configs/walls/demo-2x2.toml --scene configs/scenes/demo.toml \
		--headless --frames 240 --capture out/demo --report out/demo/report.json
	@echo
	@echo "The whole wall:  out/demo/wall.png"
	@echo "What it took:    out/demo/report.json"

picture: demo ## renews the picture in the README
	mkdir -p tests/pictures
	cp out/demo/wall.png tests/pictures/wall.png

test: ## all tests, with a GPU (a software driver will do) required
	@.ci/setup test
	@$(MAKE) --no-print-directory data
	REQUIRE_GPU=1 cargo test --release --workspace --locked

bench: setup data ## measures swap skew, cold starts, frame times and imports; plots in out/bench
	$(TERRAWALL) bench all

lint: ## format check, and clippy with warnings denied
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets --locked -- -D warnings

clean: ## removes everything that was built, imported or drawn
	rm -rf out
	cargo clean
