#!/usr/bin/env bash
# Fetches a webcam's film of a real tree, tree.avi of Debian's package opencv-doc (OpenCV's samples, Apache 2.0), into
# target/real. Nothing is installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
into=target/real
sum=4666099d0f704e310047b2f0a5ec9f936cb76a7271de9a2e70a0c57f82ac82dc

fail() {
    printf 'test-real: %s\n' "$*" >&2
    exit 1
}

whole() { [[ -f $into/tree.avi ]] && echo "$sum  $into/tree.avi" | sha256sum --check --status; }

whole && exit 0
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || fail "the clip is in a Debian package; apt-get is missing"
mkdir -p $into
work=$(mktemp -d -p $into)
trap 'rm -rf "$work"' EXIT
(cd "$work" && apt-get -qq download opencv-doc) ||
    fail "the package opencv-doc cannot be fetched (96 MB); check the network, or as root run: apt-get update"
dpkg-deb --fsys-tarfile "$work"/opencv-doc_*.deb |
    tar -x -C "$work" --wildcards '*/examples/data/tree.avi*' || fail "the package holds no tree.avi"
found=$(find "$work" -name 'tree.avi*' -type f | head -n 1)
case $found in
*.gz) gzip -dc "$found" >$into/tree.avi ;;
*) mv "$found" $into/tree.avi ;;
esac
whole || fail "tree.avi of the package opencv-doc is another than this test knows"
