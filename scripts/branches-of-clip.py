#!/usr/bin/env python3
"""Make the small file of true branches beside a recording from a ground-truth clip: branches-of-clip.py CLIP_DIR OUT.json

Needs numpy. `branches`: for each, in the order of their ids, its parent (-1: the trunk), where on the parent it is
attached and its own length, m, and its middle line in the picture at rest, px. `points`: u, v in frame 0 and the branch
of some visible points.
"""
import json
import sys
from pathlib import Path
import numpy as np

POINTS, SEED = 1800, 7

if len(sys.argv) != 3:
    sys.exit(__doc__)
clip = Path(sys.argv[1])
truth = json.loads((clip / "truth.json").read_text())
grid = np.load(clip / "grid.npz")
camera = truth["camera"]
(cx, cy), scale = camera["center_xy"], camera["px_per_m_at_z0"]
by_id = {b["id"]: b for b in truth["branches"]}


def branch(b):
    line = [[truth["width"] / 2 - 0.5 + scale * (x - cx), truth["height"] / 2 - 0.5 - scale * (y - cy)]
            for x, y, _ in b["rest_polyline"]]
    parent = by_id.get(b["parent"])
    return {"parent": b["parent"], "attached_m": round(b["attach_frac"] * parent["length"], 3) if parent else 0,
            "length_m": b["length"], "line_px": np.round(line, 1).tolist()}


assert sorted(by_id) == list(range(len(by_id)))
chosen = np.sort(np.random.default_rng(SEED).permutation(len(grid["branch"]))[:POINTS])
points = [[round(float(u), 1), round(float(v), 1), int(b)] for (u, v), b in zip(grid["pix0"][chosen], grid["branch"][chosen])]
out = {"branches": [branch(by_id[i]) for i in range(len(by_id))], "points": points}
Path(sys.argv[2]).write_text(json.dumps(out, separators=(",", ":")) + "\n")
