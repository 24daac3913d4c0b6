#!/usr/bin/env bash
# Builds the page of `export --format html` into target/viewer/viewer.html, which build.rs puts into the program.
# npm fetches three.js and esbuild by the lock file; nothing of them is kept in the repository.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'viewer: %s\n' "$*" >&2
    exit 1
}

command -v npm >/dev/null && command -v node >/dev/null ||
    fail "npm is not installed; on Debian or Ubuntu: sudo apt-get install npm"
out=$(realpath -m "${CARGO_TARGET_DIR:-target}")/viewer
# Beside the repository's sources, packages would be taken for part of them.
mkdir -p "$out/npm"
find "$out/npm" -maxdepth 1 -type f -delete
cp src/export/viewer/* "$out/npm/"
cd "$out/npm"
if ! cmp -s package-lock.json node_modules/.arborcam-lock; then
    # No package's own scripts: none is needed, and none is run as whoever builds.
    npm ci --ignore-scripts --no-audit --no-fund --loglevel=error || fail "npm could not fetch the packages; see above"
    cp package-lock.json node_modules/.arborcam-lock
fi
node build.mjs "$out/viewer.html.new" || fail "the page could not be put together; see above"
# A file that stays the same does not make cargo build anew.
if cmp -s "$out/viewer.html.new" "$out/viewer.html"; then
    rm "$out/viewer.html.new"
else
    mv "$out/viewer.html.new" "$out/viewer.html"
fi
