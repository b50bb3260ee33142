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

.PHONY: help setup build data demo layers wireframe siegen picture test bench refine lint clean

help: ## lists these targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' Makefile

setup: ## installs a software Vulkan driver where there is none (root), or says how
	@.ci/setup

build: ## builds the terrawall command
	cargo build --release --workspace --locked

data: build $(addprefix $(DATA)/.,elevation imagery etopo5 srtm landsat radar) ## imports the embedded data into out/data

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

# The same models apart, for scenes that fuse them themselves; and raw samples of other sensors.
$(DATA)/.etopo5: $(SOURCES)/etopo5.tif $(IMPORTER) | build
	rm -rf $(DATA)/etopo5
	$(TERRAWALL) import $(SOURCES)/etopo5.tif --into $(DATA)/etopo5 --kind elevation
	@touch $@

$(DATA)/.srtm: $(SOURCES)/N45E006.zip $(IMPORTER) | build
	rm -rf $(DATA)/srtm
	$(TERRAWALL) import $(SOURCES)/N45E006.zip --into $(DATA)/srtm --kind elevation
	@touch $@

$(DATA)/.landsat: $(SOURCES)/iguazu.tif $(IMPORTER) | build
	rm -rf $(DATA)/landsat
	$(TERRAWALL) import $(SOURCES)/iguazu.tif --into $(DATA)/landsat --kind imagery
	@touch $@

$(DATA)/.radar: $(SOURCES)/ironwood.tif $(IMPORTER) | build
	rm -rf $(DATA)/radar
	$(TERRAWALL) import $(SOURCES)/ironwood.tif --into $(DATA)/radar --kind sar
	@touch $@

demo: setup data ## flies over the Earth on a wall of four nodes and leaves a picture and a report
	@rm -rf out/demo
	$(TERRAWALL) up configs/walls/demo-2x2.toml --scene configs/scenes/demo.toml \
		--headless --frames 240 --capture out/demo --report out/demo/report.json
	@echo
	@echo "The whole wall:  out/demo/wall.png"
	@echo "What it took:    out/demo/report.json"

# One frame a quarter of a second: the camera's path reaches its three places at frames 1, 17 and 33.
LAYERS := $(TERRAWALL) up configs/walls/single.toml --scene configs/scenes/layers.toml --headless --no-control --fps 4

layers: setup data ## fuses layers, looks at them through lenses, and leaves three pictures
	@rm -rf out/layers
	$(LAYERS) --frames 1 --capture out/layers/alps
	$(LAYERS) --frames 17 --capture out/layers/itaipu
	$(LAYERS) --frames 33 --capture out/layers/ironwood
	@echo
	@echo "The pictures:  out/layers/{alps,itaipu,ironwood}/wall.png"

wireframe: setup data ## draws the edges of a refined mesh, and leaves a picture
	@rm -rf out/wireframe
	$(TERRAWALL) up configs/walls/single.toml --scene configs/scenes/wireframe.toml --headless --no-control \
		--frames 1 --capture out/wireframe
	@echo "The picture:  out/wireframe/wall.png"

siegen: setup data ## draws a laboratory with a curved wall, with a fifth of its pixels along each side, and leaves a picture
	@rm -rf out/siegen
	LP_NUM_THREADS=1 $(TERRAWALL) up configs/walls/vrlab-siegen.toml --scene configs/scenes/verify-mountains.toml --headless \
		--no-control --pixels 0.2 --frames 2 --capture out/siegen
	@echo "The picture of all screens:  out/siegen/wall.png"

picture: demo layers wireframe siegen ## renews the pictures in the README
	mkdir -p tests/pictures
	cp out/demo/wall.png tests/pictures/wall.png
	cp out/wireframe/wall.png tests/pictures/wireframe.png
	cp out/siegen/wall.png tests/pictures/siegen.png
	for place in alps itaipu ironwood; do cp out/layers/$$place/wall.png tests/pictures/layers-$$place.png; done

test: ## all tests, with a GPU (a software driver will do) required
	@.ci/setup test
	@$(MAKE) --no-print-directory data
	REQUIRE_GPU=1 cargo test --release --workspace --locked

bench: setup data ## measures swap skew, cold starts, frame times, meshes and imports; plots in out/bench
	$(TERRAWALL) bench all

refine: setup data ## measures refined meshes beside brute force over a zoom and changes, in full; plots in out/bench
	$(TERRAWALL) bench refine

lint: ## format check, and clippy with warnings denied
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets --locked -- -D warnings

clean: ## removes everything that was built, imported or drawn
	rm -rf out
	cargo clean
