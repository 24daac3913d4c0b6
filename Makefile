# make demo: from a fresh machine to a moving tree in out/demo. make test: every test. make bench: the figures.
.PHONY: demo build test bench lint setup

demo: setup build
	@scripts/demo.sh

setup:
	@scripts/setup.sh

build:
	cargo build --release --locked

test:
	cargo test --release --locked

bench:
	cargo bench --locked

lint:
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
