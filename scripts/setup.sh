#!/usr/bin/env bash
# Prepares a Debian or Ubuntu machine to build arborcam: installs what is missing of apt-packages.txt and tells cargo
# where OpenCV is. Changes nothing where all is there; may be run as often as one likes.
# With --tests also what only tests and pictures need: apt-packages-test.txt, and modules by tests/npm/package-lock.json.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

need_rust=90 # 1.90, as in Cargo.toml

fail() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

check_rust() {
    command -v cargo >/dev/null && command -v rustc >/dev/null ||
        fail "Rust is not installed; install 1.$need_rust or newer from https://rustup.rs and open a new shell"
    local version minor
    version=$(rustc --version | cut -d' ' -f2)
    minor=${version#1.}
    minor=${minor%%.*}
    [[ $version == 1.* && $minor =~ ^[0-9]+$ ]] && ((minor < need_rust)) || return 0
    fail "Rust $version is too old, 1.$need_rust is needed; run \`rustup update stable\`," \
        "or install it from https://rustup.rs"
}

tests=
case ${1-} in
'') ;;
--tests) tests=yes ;;
*) fail "$1 is unknown; only --tests is" ;;
esac

need_node=18

# Node from elsewhere will do, and Debian's npm would pull in a second one.
own_node() {
    local version
    command -v npm >/dev/null && version=$(node --version 2>/dev/null) || return 1
    version=${version#v}
    ((${version%%.*} >= need_node))
}

wanted_packages() {
    local lists=(scripts/apt-packages.txt) leave_out=()
    if [[ -n $tests ]]; then
        lists+=(scripts/apt-packages-test.txt)
        ! own_node || leave_out=(-e '^nodejs$' -e '^npm$')
    fi
    sed 's/#.*//' "${lists[@]}" | tr -s '[:space:]' '\n' | sed '/^$/d' | grep -v "${leave_out[@]:--e^-}"
}

installed() {
    # From wherever it is: Debian's own is made of some hundred packages.
    [[ $1 == npm ]] && command -v npm >/dev/null && return
    # The bindings' generator finds a clang with a number in its name, too.
    local names=("$1")
    [[ $1 == clang ]] && names+=('clang-[0-9]*')
    # It fails as soon as one of the names is unknown, and still answers for the others.
    local states
    states=$(dpkg-query -W -f='${db:Status-Status}\n' "${names[@]}" 2>/dev/null || true)
    grep -qx installed <<<"$states"
}

install_missing() {
    local package missing=() as_root=()
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
        fail "no apt here; install what these Debian packages hold with your own package manager:" $(wanted_packages)
    for package in $(wanted_packages); do
        installed "$package" || missing+=("$package")
    done
    if ((${#missing[@]} == 0)); then
        echo "setup: all packages are there"
        return
    fi
    if ((EUID != 0)); then
        command -v sudo >/dev/null || fail "not root and no sudo; as root run: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    echo "setup: installing ${missing[*]}"
    as_root+=(env DEBIAN_FRONTEND=noninteractive apt-get)
    "${as_root[@]}" update || fail "apt-get update fails; see above, and check the network"
    "${as_root[@]}" install -y --no-install-recommends "${missing[@]}" ||
        fail "apt-get could not install ${missing[*]}; see above"
}

# The single OpenCV packages have no opencv4.pc, so the opencv crate must be told.
write_cargo_config() {
    local triple include file=.cargo/config.toml content
    triple=$(gcc -print-multiarch 2>/dev/null || true)
    [[ -n $triple ]] || triple=$(dpkg-architecture -qDEB_HOST_MULTIARCH 2>/dev/null || true)
    [[ -n $triple ]] || fail "cannot tell this machine's library folder; is gcc installed?"
    [[ -e /usr/include/opencv4/opencv2/core.hpp ]] || fail "OpenCV's headers are not in /usr/include/opencv4"
    [[ -e /usr/lib/$triple/libopencv_core.so ]] || fail "OpenCV's libraries are not in /usr/lib/$triple"
    include=/usr/include/opencv4
    # cvconfig.h differs from machine to machine and lies apart.
    [[ ! -d /usr/include/$triple/opencv4 ]] || include+=,/usr/include/$triple/opencv4
    content="# Written by scripts/setup.sh: where this machine keeps OpenCV.
[env]
OPENCV_LINK_LIBS = \"opencv_core,opencv_imgproc,opencv_video\"
OPENCV_LINK_PATHS = \"/usr/lib/$triple\"
OPENCV_INCLUDE_PATHS = \"$include\""
    # A file that is rewritten with the same content would make cargo build OpenCV's bindings again.
    if [[ -e $file && $(<"$file") == "$content" ]]; then
        echo "setup: $file is up to date"
        return
    fi
    mkdir -p .cargo
    if [[ -e $file ]] && ! grep -q 'Written by scripts/setup.sh' "$file"; then
        cp "$file" "$file.bak"
        echo "setup: your $file is kept as $file.bak"
    fi
    printf '%s\n' "$content" >"$file"
    echo "setup: wrote $file"
}

check_rust
install_missing
write_cargo_config
[[ -z $tests ]] || scripts/test-modules.sh || fail "the tests' modules could not be fetched; see above"
echo "setup: done; build with: cargo build --release"
