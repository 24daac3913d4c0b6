#!/usr/bin/env bash
# Replays the clip in recordings/ and leaves a capture in out/demo: on the screen where there is a terminal, else
# without. An earlier demo makes way.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=out/demo
rm -rf "$out"
how=(--fast --headless)
if [[ -t 0 && -t 1 ]]; then
    how=()
    echo "demo: press q to leave early, ? for help"
fi
target/release/arborcam replay recordings/sparse_winter.mkv --outline recordings/sparse_winter.outline.json \
    --out "$out" "${how[@]}"
echo "demo: $out holds the capture; open $out/tree.glb in Blender, a game engine or a glTF viewer"
