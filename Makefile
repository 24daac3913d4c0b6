# make demo: from a fresh machine to a moving tree in out/demo. make test: from a fresh machine through every test. Both
# install what is missing (scripts/setup.sh). make bench: the figures.
# make pictures: those of README and docs (CLIPS=folder for the oak too), and out/CLIP.png, film beside model.
# make install, make uninstall: program and service, below DESTDIR (for packages) and PREFIX.
.PHONY: demo pictures build viewer test test-v4l2 test-real bench sweep lint core setup install uninstall

demo: setup build
	@scripts/demo.sh

# ONLY=views, film, shapes, wind, grown, sketch, photo, cloud, markers, hu, forest, points, terminal, page or sheets for one group. CLIPS is ARBORCAM_CLIPS if not given.
pictures: build
	@CLIPS="$(CLIPS)" ONLY="$(ONLY)" scripts/pictures.sh

setup:
	@scripts/setup.sh

# With the HTML viewer where npm is there; without it the program is complete but for `export --format html`.
build:
	@scripts/build-viewer.sh || echo "build: goes on without the HTML viewer, see above" >&2
	cargo build --release --locked

viewer:
	@scripts/build-viewer.sh

# The V4L2 tests take a virtual machine (tests/vm); what could not be run is said at the end.
test:
	@scripts/setup.sh --tests
	@rm -f target/vm-runs/absent
	@scripts/build-viewer.sh || echo "test: goes on without the tests of the HTML viewer" >&2
	cargo test --release --locked
	@! test -s target/vm-runs/absent || cat target/vm-runs/absent >&2

test-v4l2:
	ARBORCAM_REQUIRE_VM=1 cargo test --release --locked --test v4l2

# A real tree, and a hand before it; fetches 96 MB once.
test-real:
	scripts/fetch-real-clip.sh
	scripts/fetch-real-cloud.sh
	cargo test --release --locked --test real_clip --test real_cloud -- --ignored --nocapture

# ONLY=tracking for the tracker alone, ONLY=animate for the animation.
bench:
	cargo bench --locked --bench figures -- $(ONLY)

# The tree over the ranges of its settings; CLIP="film outline branches" for another clip than the shipped one.
sweep:
	cargo bench --locked --bench sweep -- $(CLIP)

lint: core
	cargo fmt --check
	cargo clippy --release --locked --all-targets -- -D warnings

# The library without OpenCV, camera and terminal, with the example that uses it; the program without nokhwa.
core:
	cargo check --release --locked --no-default-features --lib --example tree_from_tracks
	cargo clippy --release --locked --no-default-features --features terminal -- -D warnings

PREFIX ?= /usr/local
# Where the system looks for its parts; below /usr/local it reads neither udev rules nor all of the others.
SYSTEM ?= /usr/lib
BINARY ?= target/release/arborcam
put = install -D -m
with_prefix = sed 's|@PREFIX@|$(PREFIX)|g'
DOCS = README.md docs/using.md docs/camera.md docs/recordings.md docs/files.md docs/settings.md docs/service.md docs/outline.md docs/method.md docs/dynamics.md docs/sweep.md docs/viewer.md docs/gallery.md docs/animate.md docs/analyze.md docs/grow.md docs/forest.md docs/sketch.md docs/photo.md docs/markers.md docs/depth.md docs/clouds.md
LENSES = $(addprefix config/lenses/, LICENSE README.md apple-iphone-11.json arducam-imx477-6mm.json google-pixel-4a.json raspberry-pi-camera-3.json raspberry-pi-hq-3.2mm.json)
INSTALLED = $(PREFIX)/bin/arborcam $(PREFIX)/lib/arborcam/arborcam-service \
	$(addprefix $(PREFIX)/share/arborcam/, arborcam.toml sbc.toml) \
	$(addprefix $(PREFIX)/share/arborcam/, $(LENSES:config/%=%)) \
	$(addprefix $(PREFIX)/share/doc/arborcam/, $(notdir $(DOCS))) \
	$(SYSTEM)/systemd/system/arborcam@.service $(SYSTEM)/udev/rules.d/70-arborcam.rules \
	$(SYSTEM)/sysusers.d/arborcam.conf $(SYSTEM)/tmpfiles.d/arborcam.conf

# Builds nothing: `make build` first, as the user that has Rust.
install:
	@test -x $(BINARY) || { echo "install: $(BINARY) is not there; run \`make build\` first" >&2; exit 1; }
	$(put) 755 $(BINARY) $(DESTDIR)$(PREFIX)/bin/arborcam
	install -d $(DESTDIR)$(PREFIX)/lib/arborcam $(DESTDIR)$(SYSTEM)/systemd/system
	$(with_prefix) systemd/arborcam-service > $(DESTDIR)$(PREFIX)/lib/arborcam/arborcam-service
	chmod 755 $(DESTDIR)$(PREFIX)/lib/arborcam/arborcam-service
	$(with_prefix) systemd/arborcam@.service > $(DESTDIR)$(SYSTEM)/systemd/system/arborcam@.service
	chmod 644 $(DESTDIR)$(SYSTEM)/systemd/system/arborcam@.service
	$(put) 644 systemd/70-arborcam.rules $(DESTDIR)$(SYSTEM)/udev/rules.d/70-arborcam.rules
	$(put) 644 systemd/arborcam.sysusers $(DESTDIR)$(SYSTEM)/sysusers.d/arborcam.conf
	$(put) 644 systemd/arborcam.tmpfiles $(DESTDIR)$(SYSTEM)/tmpfiles.d/arborcam.conf
	install -d $(DESTDIR)$(PREFIX)/share/arborcam $(DESTDIR)$(PREFIX)/share/doc/arborcam
	install -m 644 config/arborcam.toml config/sbc.toml $(DESTDIR)$(PREFIX)/share/arborcam
	install -d $(DESTDIR)$(PREFIX)/share/arborcam/lenses
	install -m 644 $(LENSES) $(DESTDIR)$(PREFIX)/share/arborcam/lenses
	install -m 644 $(DOCS) $(DESTDIR)$(PREFIX)/share/doc/arborcam
	@test -n "$(DESTDIR)" || scripts/activate.sh

# Captures and /etc/arborcam are the user's and stay.
uninstall:
	rm -f $(addprefix $(DESTDIR), $(INSTALLED))
	-rmdir $(addprefix $(DESTDIR)$(PREFIX)/, lib/arborcam share/arborcam/lenses share/arborcam share/doc/arborcam) 2>/dev/null
	@test -n "$(DESTDIR)" || scripts/activate.sh
