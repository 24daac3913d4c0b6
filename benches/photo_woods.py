#!/usr/bin/env python3
"""How well `arborcam photo` finds the wood of several trees in one photograph.

  photo_woods.py ARBORCAM WORK_DIR SEED... [--trees COUNT]

Each seed is a made photograph of bare trees, one behind the other (made_photos.py --trees), each with its crown stroke and its
branch stroke. One row a photograph: of each tree, the nearest first, the wood that is found against the wood that is seen,
shared pixels by all of either, where its crown stroke alone leads round. Needs numpy, scipy and opencv-python-headless.
"""
import argparse, json, subprocess, sys
from pathlib import Path

import cv2
import numpy as np

import photos

HERE = Path(__file__).parent
LIKELY = 127


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam")
    parser.add_argument("work_dir", type=Path)
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--trees", type=int, default=4)
    args = parser.parse_args()
    shares = []
    for seed in args.seeds:
        row = shares_of(args, seed)
        print(f"{seed:<8}" + "".join(f"{share:7.2f}" for share in row), flush=True)
        shares += row
    print(f"{len(shares)} trees: mean {np.mean(shares):.2f}, median {np.median(shares):.2f}, "
          f"a quarter of them below {np.quantile(shares, 0.25):.2f}")


def shares_of(args, seed):
    folder, out = args.work_dir / f"wood-{seed}", args.work_dir / f"scene-{seed}"
    if not (folder / "truth.json").is_file():
        made = [sys.executable, HERE / "made_photos.py", args.work_dir, folder.name, str(seed), "bare", "--trees", str(args.trees)]
        subprocess.run(made, check=True)
    subprocess.run(["rm", "-rf", out], check=True)
    trees = [folder / f"tree-{k + 1}.json" for k in range(args.trees)]
    strokes = [part for tree in trees for part in ("--tree", tree)]
    ran = subprocess.run([args.arborcam, "photo", folder / "photo.jpg", *strokes, "--out", out], capture_output=True, text=True)
    if ran.returncode:
        print(f"{seed}: {ran.stderr.strip()}")
        return [0.0] * args.trees
    true = cv2.imread(str(folder / "wood.png"), 0) > LIKELY
    crowns = [crown(tree, true.shape) for tree in trees]
    often = np.sum(crowns, axis=0)
    alone = [own & (often == 1) for own in crowns]
    return [photos.iou(found(out, k, true.shape) & alone[k], true & alone[k]) for k in range(args.trees)]


def crown(tree, shape):
    inside = np.zeros(shape, np.uint8)
    cv2.fillPoly(inside, [np.array(json.loads(tree.read_text())["polygon_px"], np.int32)], 1)
    return inside > 0


def found(out, k, shape):
    mask = cv2.imread(str(out / f"tree-{k + 1:04}" / "wood.png"), 0)
    return np.zeros(shape, bool) if mask is None else mask > LIKELY


if __name__ == "__main__":
    main()
