#!/usr/bin/env bash
# Fetches laser scans of two real trees, of the test data of the R package ITSMe (Terryn et al. 2023, MIT), into target/real.
# Nothing is installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
into=target/real
from=https://raw.githubusercontent.com/lmterryn/ITSMe/6cfb11c18efb3b12a4e12d38ea1cbf426b777e7b/tests/non_buttressed_trees

fail() {
    printf 'test-real: %s\n' "$*" >&2
    exit 1
}

whole() { [[ -f $into/$1 ]] && echo "$2  $into/$1" | sha256sum --check --status; }

fetch() {
    whole "$1" "$2" && return
    command -v curl >/dev/null || fail "curl is missing"
    mkdir -p $into
    curl -fsSL -o "$into/$1" "$from/$1" || fail "$1 cannot be fetched (1 MB); check the network"
    whole "$1" "$2" || fail "$1 is another than this test knows"
}

fetch tree_1_pc.txt 229b3e4f076728ac2c2d2b22d538bd087a3c49252b4529f06d703958f725eb42
fetch tree_2_pc.txt 566fbc1f46e090bdde1b3bf3503db63753b7cf8c3548129680115639126a7022
