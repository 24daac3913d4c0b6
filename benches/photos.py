#!/usr/bin/env python3
"""How well `arborcam photo` makes trees of photographs whose truth is known.

  photos.py ARBORCAM WORK_DIR SEED... [--without-strokes | --careless] [--json FILE]

Each seed is a made photograph (made_photos.py, 1500 px wide): odd seeds are bare, even ones in leaf. It gets a crown stroke and
a branch stroke along the trunk, or none; a careless one goes up a third of the way, beside the middle by half of the radius.
One row a photograph:

  foliage     leaves.png of the document against the leaves that are seen, shared pixels by all of either; in leaf only
  on_wood     share of the traced edges' length with a true branch within 4 px that runs within 30 degrees of it
  covered     share of the seen true branches' length with a traced edge within 4 px and 30 degrees; radius_err: see wood_score.py
  silhouette  all that tree.glb draws, seen from the front, against all that is tree in the photograph, as foliage
  extent      from the side: how deep the wood is in each quarter of the height (90 % of its length), by the truth
  fullness    from the side: cells of 2.5 % of the height that hold wood in each quarter, by the truth; extent and fullness are
              means of |ratio - 1| over the quarters that hold 10 % of the true wood's length at least
  far_leaves  share of the true leaves, seen from the front, that are more than 2.5 % of the width from the model's wood
  seconds     wall clock of the whole command; MB its greatest memory

Pixels at 1500 px width: 4 px there are 1.7 px of a film. The last rows are medians. Needs numpy, scipy and
opencv-python-headless.
"""
import argparse, json, subprocess, sys, time
from pathlib import Path

import cv2
import numpy as np

import wood_score

HERE = Path(__file__).parent
QUARTERS, CELL, REACH, LEAST_SHARE, FAR = 4, 0.025, 0.9, 0.1, 0.025
COLUMNS = ["foliage", "on_wood", "covered", "radius_err", "silhouette", "extent", "fullness", "far_leaves", "nodes", "seconds", "MB"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam")
    parser.add_argument("work_dir", type=Path)
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--without-strokes", action="store_true")
    parser.add_argument("--careless", action="store_true")
    parser.add_argument("--json", type=Path)
    args, more = parser.parse_known_args()
    rows = {}
    print("seed     " + "".join(f"{c:>11}" for c in COLUMNS))
    for seed in args.seeds:
        rows[seed] = row(args, seed, more)
        print(line(f"{seed} {'bare' if seed % 2 else 'leaf'}", rows[seed]), flush=True)
    for look, odd in (("bare", 1), ("leaf", 0)):
        own = [r for seed, r in rows.items() if seed % 2 == odd and "failed" not in r]
        medians = {c: float(np.median([r[c] for r in own])) for c in COLUMNS if own and all(c in r for r in own)}
        print(line(f"{look} ({len(own)})", medians))
    if args.json:
        args.json.write_text(json.dumps(rows))


def line(name, figures):
    if "failed" in figures:
        return f"{name:9}  {figures['failed']}"
    return f"{name:9}" + "".join(f"{figures[c]:11.2f}" if c in figures else f"{'-':>11}" for c in COLUMNS)


def row(args, seed, more):
    folder, look = args.work_dir / f"photo-{seed}", "bare" if seed % 2 else "leaves"
    if not (folder / "truth.json").is_file():
        subprocess.run([sys.executable, HERE / "made_photos.py", args.work_dir, folder.name, str(seed), look], check=True)
    out = args.work_dir / f"tree-{seed}"
    subprocess.run(["rm", "-rf", out], check=True)
    trunk = careless(folder) if args.careless else folder / "trunk.json"
    strokes = [] if args.without_strokes else ["--crown", folder / "crown.json", "--branch", trunk]
    begin = time.monotonic()
    run = subprocess.Popen([args.arborcam, "photo", folder / "photo.jpg", *strokes, *more, "--out", out],
                           stderr=subprocess.PIPE, text=True)
    said = run.stderr.read()
    run.wait()
    seconds = time.monotonic() - begin
    if run.returncode:
        return {"failed": said.strip()}
    figures = dict(seconds=seconds, MB=peak_mb(args.arborcam, folder, strokes, more, args.work_dir / "peak"))
    film, capture = wood_score.Film(folder), wood_score.Capture(out)
    mesh = wood_score.Mesh(capture)
    true_wood, true_leaves = (cv2.imread(str(folder / name), 0) for name in ("wood.png", "leaves.png"))
    if look == "leaves":
        figures["foliage"] = iou(cv2.imread(str(out / "leaves.png"), 0) > 127, true_leaves > 127)
        figures["far_leaves"] = far(true_leaves > 127, mesh.front(film.size))
    figures |= traced(film, capture)
    figures["silhouette"] = iou(mesh.front(film.size, leaves=True), np.maximum(true_wood, true_leaves) > 127)
    figures |= side(film, capture)
    figures["nodes"] = len(capture.rows)
    return figures


def careless(folder):
    """The trunk's stroke as a hurried hand draws it."""
    drawn = json.loads((folder / "trunk.json").read_text())
    trunk = json.loads((folder / "truth.json").read_text())["branches"][0]
    beside = 0.5 * trunk["rest_radius_px"][0]
    line = drawn["polyline_px"][:max(len(drawn["polyline_px"]) // 3, 2)]
    drawn["polyline_px"] = [[u - beside, v] for u, v in line]
    path = folder / "careless.json"
    path.write_text(json.dumps(drawn))
    return path


def peak_mb(arborcam, folder, strokes, more, out):
    code = ("import resource, subprocess, sys; subprocess.run(sys.argv[1:], stderr=subprocess.DEVNULL);"
            "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)")
    command = [arborcam, "photo", folder / "photo.jpg", *strokes, *more, "--out", out]
    subprocess.run(["rm", "-rf", out], check=True)
    ran = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, check=True)
    subprocess.run(["rm", "-rf", out], check=True)
    return int(ran.stdout) / 1024


def iou(found, true):
    return float((found & true).sum() / max((found | true).sum(), 1))


def far(leaves, wood):
    """Share of the leaves' pixels that have no wood near them."""
    away = cv2.distanceTransform((~wood).astype(np.uint8), cv2.DIST_L2, 5)
    return float((away[leaves] > FAR * leaves.shape[1]).sum() / max(leaves.sum(), 1))


def traced(film, capture):
    seen, true, in_sight = capture.line(), film.line("rest_polyline"), film.line_in_sight("rest_polyline")
    ratio = wood_score.radius_ratios(seen, in_sight)
    return dict(on_wood=wood_score.share_near(seen, true), covered=wood_score.share_near(in_sight, seen),
                radius_err=float(np.median(np.abs(ratio - 1))))


def side(film, capture):
    """How far depth and fullness are off from the side, as shares of the truth."""
    scale = film.truth["camera"]["px_per_m_at_z0"]
    truth = np.concatenate([points_along(scale * np.array(b["rest_polyline"], float)) for b in film.branches])
    edges = [np.stack([capture.place[p], capture.place[k]]) / capture.px for p, k in capture.all_edges()]
    own = np.concatenate([points_along(edge) for edge in edges])
    height = truth[:, 1].max()
    extents, fullness = [], []
    for quarter in range(QUARTERS):
        inside = lambda points: points[(points[:, 1] >= quarter * height / QUARTERS) &
                                       (points[:, 1] < (quarter + 1) * height / QUARTERS)]
        t, o = inside(truth), inside(own)
        if len(t) < LEAST_SHARE * len(truth):
            continue
        if not len(o):
            extents.append(1.0), fullness.append(1.0)
            continue
        extents.append(abs(extent(o) / max(extent(t), 1e-9) - 1))
        fullness.append(abs(cells(o, height) / max(cells(t, height), 1) - 1))
    return dict(extent=float(np.mean(extents)), fullness=float(np.mean(fullness)))


def points_along(line, step=2.0):
    """Places along a line in space, about so many pixels apart."""
    pieces = []
    for a, b in zip(line[:-1], line[1:]):
        count = max(int(np.linalg.norm(b - a) / step), 1)
        pieces.append(a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None])
    return np.concatenate(pieces)


def extent(points):
    low, high = np.quantile(points[:, 2], [(1 - REACH) / 2, (1 + REACH) / 2])
    return high - low


def cells(points, height):
    return len(np.unique(np.floor(points[:, [2, 1]] / (CELL * height)).astype(int), axis=0))


if __name__ == "__main__":
    main()
