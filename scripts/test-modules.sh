#!/usr/bin/env bash
# Fetches what the tests of the exported files need from npm, by the lock file, into target/test-npm.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
command -v npm >/dev/null || {
    echo "test-modules: npm is not installed; on Debian or Ubuntu: sudo apt-get install npm" >&2
    exit 1
}
out=$(realpath -m "${CARGO_TARGET_DIR:-target}")/test-npm
mkdir -p "$out"
cp tests/npm/package.json tests/npm/package-lock.json "$out/"
cd "$out"
# Fetched once for each lock file.
if ! cmp -s package-lock.json node_modules/.arborcam-lock; then
    npm ci --ignore-scripts --no-audit --no-fund --loglevel=error
    cp package-lock.json node_modules/.arborcam-lock
fi
