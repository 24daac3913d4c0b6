#!/usr/bin/env python3
"""What `arborcam photo` does with bad strokes, with strokes drawn half a pixel beside, and how right it is without any.

  photos_trust.py ARBORCAM WORK_DIR bad|beside|none|crown|branch SEED... [--json FILE]

Each seed is a made photograph as of photos.py, with its crown stroke and its trunk stroke.

bad      how many photographs are refused with good strokes (which is wrong), and with each kind of bad ones (which is right):
  good       crown and trunk
  branches   these, and ten further strokes along branches of which 0.6 are in sight, drawn 2 px off, one at a time; a warning
             counts as refused
  free       the trunk's stroke where no tree is: on the sky, a lawn or a hedge
  beside     the trunk's stroke moved aside by a twelfth of the width, or where no tree is
  branch     a further stroke where no tree is, as for branches
  crown      the crown's stroke moved to a corner of the picture where least tree is
  red        --foliage red (in leaf only)
  swapped    crown and trunk exchanged
beside   the same photograph with all strokes moved by half a pixel to the right or down, and as SVG: how far the trees are
         alike. wood: share of the traced length of either that lies within 2 px of the other and runs alike; silhouette: pixels
         of the tree from the front that both have, by those of either; both are means over the pairs
none     no stroke, of the whole photograph and of five parts of it, in which the tree stands elsewhere: what it says of its
         certainty, and whether the tree is right. It is if 0.8 of the traced length lies on the true tree (6 px), the foot is
         within 5 % of the tree's height, and in leaf the leaves meet the true ones by 0.6, or 0.4 of the true wood is
         covered of a bare one
crown    the same with the crown's stroke alone, as far as it lies in the part
branch   the same with the trunk's stroke alone, of the parts that hold it
fit      JSON files of these three in place of seeds: the weights of src/pipeline/certainty.rs. They are to be of a build whose
         LEAST_CHANCE is 0, which makes doubtful trees, too

Needs numpy, scipy and opencv-python-headless.
"""
import argparse, itertools, json, re, subprocess, sys
from pathlib import Path

import cv2
import numpy as np

import wood_score
from photos import iou

HERE = Path(__file__).parent
HALF = [(0.5, 0), (0, 0.5)]
MOST_DEVIATIONS = 15.0  # as in src/pipeline/certainty.rs
# Left, top, right, bottom of a part, as shares of the picture.
PARTS = [(0, 0, 1, 1), (0.12, 0, 1, 1), (0, 0, 0.88, 1), (0.06, 0, 0.94, 1), (0.1, 0.15, 0.9, 1), (0, 0.1, 0.8, 0.95)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam")
    parser.add_argument("work_dir", type=Path)
    parser.add_argument("what", choices=["bad", "beside", "none", "crown", "branch", "fit"])
    parser.add_argument("seeds", nargs="+")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    if args.what == "fit":
        return fit(args)
    rows = []
    for seed in map(int, args.seeds):
        photo = Photo(args, seed)
        for row in {"bad": bad, "beside": beside, "none": none, "crown": crown, "branch": branch}[args.what](photo):
            rows.append(dict(seed=seed, bare=seed % 2 == 1) | row)
            print(rows[-1], flush=True)
    {"bad": sum_bad, "beside": sum_beside}.get(args.what, sum_none)(rows)
    if args.json:
        args.json.write_text(json.dumps(rows))


class Photo:
    def __init__(self, args, seed):
        self.arborcam, self.work = args.arborcam, args.work_dir
        self.folder, look = args.work_dir / f"photo-{seed}", "bare" if seed % 2 else "leaves"
        if not (self.folder / "truth.json").is_file():
            subprocess.run([sys.executable, HERE / "made_photos.py", args.work_dir, self.folder.name, str(seed), look], check=True)
        self.crown, self.trunk = (json.loads((self.folder / f"{n}.json").read_text()) for n in ("crown", "trunk"))
        self.wood, self.leaves = (cv2.imread(str(self.folder / f"{n}.png"), 0) for n in ("wood", "leaves"))
        self.tree = np.maximum(self.wood, self.leaves) > 64
        self.in_leaf = look == "leaves"

    def size(self):
        return self.tree.shape[1], self.tree.shape[0]

    def run(self, *options, picture=None):
        """The folder of the tree, or None, and what was said."""
        out = self.work / "trust-tree"
        subprocess.run(["rm", "-rf", out], check=True)
        ran = subprocess.run([self.arborcam, "photo", picture or self.folder / "photo.jpg", *options, "--out", out],
                             capture_output=True, text=True)
        return (None if ran.returncode else out), ran.stderr.strip().splitlines()[-1:] + [ran.stderr]

    def strokes(self, crown=None, trunk=None, more=()):
        files = []
        for option, name, stroke in [("--crown", "c", crown or self.crown), ("--branch", "t", trunk or self.trunk),
                                     *(("--branch", "m", m) for m in more)]:
            path = self.work / f"trust-{name}.json"
            path.write_text(json.dumps(stroke))
            files += [option, path]
        return files

    def moved(self, stroke, du, dv):
        key = "polygon_px" if "polygon_px" in stroke else "polyline_px"
        most = np.array(self.size()) - 1
        return stroke | {key: np.clip(np.array(stroke[key], float) + (du, dv), 0, most).tolist()}

    def free_line(self):
        """A line of 200 px where least tree is, and farthest from it."""
        off = cv2.distanceTransform((~self.tree).astype(np.uint8), cv2.DIST_L2, 5)
        width, height = self.size()
        best = max(itertools.product(range(120, width - 120, 40), range(120, height - 120, 40)), key=lambda at: off[at[1], at[0]])
        u, v = best
        return dict(width=width, height=height, polyline_px=[[u - 70, v + 70], [u, v + 10], [u + 70, v - 70]])


def branches(photo):
    """Strokes along branches that are seen for the most part."""
    film, rng = wood_score.Film(photo.folder), np.random.default_rng(1)
    width, height = photo.size()
    lines = []
    for branch in film.branches[1:]:
        line = film.polyline_px(branch, "rest_polyline")
        inside = (line > 1).all() and (line < np.array([width, height]) - 2).all()
        if inside and np.mean(branch["rest_seen"]) > 0.6 and np.linalg.norm(np.diff(line, axis=0), axis=1).sum() > 80:
            lines.append(dict(width=width, height=height, polyline_px=(line + rng.normal(0, 2, line.shape)).round(1).tolist()))
    return [lines[k] for k in rng.permutation(len(lines))[:10]]


def bad(photo):
    width, height = photo.size()
    aside = [photo.moved(photo.trunk, sign * width / 12, 0) for sign in (1, -1)]
    on_tree = lambda s: photo.tree[tuple(np.round(np.array(s["polyline_px"])).astype(int).T[::-1])].mean()
    crown = np.array(photo.crown["polygon_px"], float)
    small = 0.35 * (crown - crown.mean(0)) + crown.mean(0)
    places = [small - small.min(0) + (5, 5), small - small.max(0) + (width - 6, height - 6),
              small - (small[:, 0].min(), small[:, 1].max()) + (5, height - 6),
              small - (small[:, 0].max(), small[:, 1].min()) + (width - 6, 5)]
    cover = lambda p: cv2.fillPoly(np.zeros((height, width), np.uint8), [p.astype(np.int32)], 1)[photo.tree].sum()
    away = photo.crown | dict(polygon_px=min(places, key=cover).round(1).tolist())
    cases = [("good", {}, []), *(("branches", dict(more=[line]), []) for line in branches(photo)), ("free", dict(trunk=photo.free_line()), []), ("beside", dict(trunk=min(aside, key=on_tree)), []),
             ("branch", dict(more=[photo.free_line()]), []), ("crown", dict(crown=away), [])]
    if photo.in_leaf:
        cases.append(("red", {}, ["--foliage", "red"]))
    for name, strokes, more in cases:
        out, said = photo.run(*photo.strokes(**strokes), *more)
        is_refused = out is None or "along stroke" in said[1]
        yield dict(case=name, refused=is_refused, said=said[0] if is_refused else "")
    files = photo.strokes()
    out, said = photo.run("--crown", files[3], "--branch", files[1])
    yield dict(case="swapped", refused=out is None, said=said[0] if out is None else "")


def sum_bad(rows):
    for case in dict.fromkeys(r["case"] for r in rows):
        own = [r for r in rows if r["case"] == case]
        print(f"{case:8} refused {sum(r['refused'] for r in own)} of {len(own)}")


def beside(photo):
    trees = []
    for du, dv in [(0, 0), *HALF]:
        out, said = photo.run(*photo.strokes(photo.moved(photo.crown, du, dv), photo.moved(photo.trunk, du, dv)))
        trees.append(seen(photo, out) if out else None)
    out, said = photo.run("--tree", as_svg(photo))
    trees.append(seen(photo, out) if out else None)
    there = [t for t in trees if t]
    pairs = [(alike(a, b), iou(a["front"], b["front"])) for a, b in itertools.combinations(there, 2)]
    yield dict(trees=len(there), wood=float(np.mean([p[0] for p in pairs])), least_wood=float(min(p[0] for p in pairs)),
               silhouette=float(np.mean([p[1] for p in pairs])), least_silhouette=float(min(p[1] for p in pairs)))


def as_svg(photo):
    """The same strokes as a drawing, in which places are counted from the corner of the first pixel."""
    text = lambda line: " ".join(f"{u + 0.5:.2f},{v + 0.5:.2f}" for u, v in line)
    width, height = photo.size()
    path = photo.work / "trust.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">'
                    f'<polygon id="crown" points="{text(photo.crown["polygon_px"])}"/>'
                    f'<polyline id="trunk" points="{text(photo.trunk["polyline_px"])}"/></svg>')
    return path


def seen(photo, out):
    capture = wood_score.Capture(out)
    return dict(line=capture.line(), front=wood_score.Mesh(capture).front(photo.size(), leaves=True))


def alike(a, b):
    near = wood_score.NEAR_PX
    wood_score.NEAR_PX = 2.0
    share = 0.5 * (wood_score.share_near(a["line"], b["line"]) + wood_score.share_near(b["line"], a["line"]))
    wood_score.NEAR_PX = near
    return share


def sum_beside(rows):
    for bare in (True, False):
        own = [r for r in rows if r["bare"] == bare]
        if own:
            medians = {k: round(float(np.median([r[k] for r in own])), 3) for k in ("wood", "least_wood", "silhouette", "least_silhouette")}
            print("bare" if bare else "leaf", len(own), medians)


def none(photo):
    return found(photo, lambda photo, part: [])


def crown(photo):
    return found(photo, lambda photo, part: given(photo, "crown", "polygon_px", part))


def branch(photo):
    return found(photo, lambda photo, part: given(photo, "branch", "polyline_px", part))


def given(photo, option, key, part):
    """The option with a stroke as it lies in a part; None if it does not."""
    left, top, right, bottom = part
    size, line = (right - left, bottom - top), np.array((photo.crown if option == "crown" else photo.trunk)[key], float) - (left, top)
    inside = line.clip(0, np.array(size) - 1)
    if option == "branch" and (inside != line).any():
        return None
    path = photo.work / "trust-part.json"
    path.write_text(json.dumps({"width": int(size[0]), "height": int(size[1]), key: inside.tolist()}))
    return [f"--{option}", path]


def found(photo, strokes):
    image = cv2.imread(str(photo.folder / "photo.jpg"))
    width, height = photo.size()
    foot = np.array(photo.trunk["polyline_px"][0], float)
    for part in PARTS:
        left, top, right, bottom = np.round(np.array(part) * (width, height, width, height)).astype(int)
        path = photo.work / "trust-part.png"
        cv2.imwrite(str(path), image[top:bottom, left:right])
        options = strokes(photo, (left, top, right, bottom))
        if options is None:
            continue
        out, said = photo.run(*options, picture=path)
        percent = re.search(r"chance of (\d+) %", said[1])
        row = dict(part=PARTS.index(part), made=out is not None, says=int(percent[1]) / 100 if percent else None)
        if out:
            row |= evidence(out)
            row["right"] = is_right(photo, out, (left, top, right, bottom), foot - (left, top))
        else:
            row["said"] = said[0]
        yield row


def evidence(out):
    """What the tree's certainty rests on."""
    found = json.loads((out / "capture.json").read_text())["found"]
    return dict(trunk=found["trunk_deviations"], level=found["level_share"])


def fit(args):
    """Logistic regression of whether trees are right, by Newton's method; a weak prior (variance 10) keeps it finite."""
    rows = [r for path in args.seeds for r in json.loads(Path(path).read_text()) if r["made"]]
    x = np.array([[1, np.clip(r["trunk"], 0, MOST_DEVIATIONS), not r["bare"], 10 * r["level"]] for r in rows], float)
    y = np.array([r["right"] for r in rows], float)
    weights = np.zeros(x.shape[1])
    for _ in range(50):
        chance = 1 / (1 + np.exp(-x @ weights))
        hessian = (x * (chance * (1 - chance))[:, None]).T @ x + 0.1 * np.eye(len(weights))
        weights += np.linalg.solve(hessian, x.T @ (y - chance) - 0.1 * weights)
    print(f"{len(rows)} trees, {int(y.sum())} right; once, by trunk, in leaf, by a tenth of level length:", weights.round(2).tolist())


def is_right(photo, out, part, foot_px):
    left, top, right, bottom = part
    tree, wood, leaves = (m[top:bottom, left:right] for m in (photo.tree, photo.wood, photo.leaves))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (13, 13))
    capture = wood_score.Capture(out)
    line = capture.line()
    at = np.round(line.at_px).astype(int).clip(0, np.array(tree.shape[::-1]) - 1)
    on_tree = cv2.dilate(tree.astype(np.uint8), disc)[at[:, 1], at[:, 0]].mean() if len(at) else 0
    root = next(k for k, r in capture.rows.items() if not r["parent_id"])
    height = np.ptp(np.flatnonzero(tree.any(axis=1)))
    is_there = np.linalg.norm(capture.place_px[root] - foot_px) < 0.05 * height
    if photo.in_leaf:
        whole = iou(cv2.imread(str(out / "leaves.png"), 0) > 127, leaves > 127) > 0.6
    else:
        traced = np.zeros(tree.shape, np.uint8)
        traced[at[:, 1], at[:, 0]] = 1
        thick = cv2.erode((wood > 127).astype(np.uint8), np.ones((3, 3)))
        whole = cv2.dilate(traced, disc)[thick > 0].mean() > 0.4
    return bool(on_tree > 0.8 and is_there and whole)


def sum_none(rows):
    made = [r for r in rows if r["made"] and r["says"] is not None]
    print(f"{len(rows)} pictures, {len(made)} trees, {sum(r['right'] for r in made)} right")
    edges = [0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.01]
    for low, high in zip(edges[:-1], edges[1:]):
        own = [r for r in made if low <= r["says"] < high]
        if own:
            print(f"said {low:.1f} to {high:.1f}: {np.mean([r['says'] for r in own]):.2f} said, {np.mean([r['right'] for r in own]):.2f} "
                  f"right, {len(own)} trees")


if __name__ == "__main__":
    main()
