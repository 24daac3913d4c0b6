"""Whether the forks of grown trees are like those of their example.

    arborcam grow EXAMPLE --count 200 --motion none --out TREES
    python3 benches/grown_features.py EXAMPLE TREES

For every ratio of the forks (angles beside the stem and between the branches; lengths of stem and branch; mirror images
included) the distance of Kolmogorov and Smirnov between the example and the trees, and the one above which the two are
told apart at 1 %: that of two samples, of which the example's is the number of its forks. The same for the example with
every node moved at random by a share of the tree's height. Then how alike the trees are among each other, and how they
fill the outline: the mean distance of its pixels from the nearest branch. Needs numpy and Pillow.
"""

import csv
import json
import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

# Of src/grow/fork_tree.rs.
SAME_PLACE_PX = 1.0
# Shares of the tree's height by which nodes are moved (standard deviation), and how often.
JITTER = (0.02, 0.05)
JITTERED = 200
RATIOS = ("beside", "between", "stem", "branch")


def nodes_of(folder):
    """Places (u, v), parents of what is no copy."""
    places, parents, index = [], [], {}
    with open(folder / "nodes.csv", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["copy_of"]:
                continue
            index[row["node_id"]] = len(places)
            places.append((float(row["u_px"]), float(row["v_px"])))
            parents.append(index.get(row["parent_id"], -1))
    return np.array(places), parents


def distance_to_segment(point, start, end):
    along = end - start
    share = np.dot(point - start, along) / max(np.dot(along, along), 1e-300)
    return np.linalg.norm(point - start - along * min(max(share, 0.0), 1.0))


def fork_tree(places, parents):
    """Foot, forks and tips, as src/grow/fork_tree.rs makes them: places, parents."""
    children = [[] for _ in parents]
    for i, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(i)
    kept, below = [], []
    waiting = [(0, -1)]
    while waiting:
        node, parent = waiting.pop()
        own = sorted(children[node], key=lambda c: np.linalg.norm(places[c] - places[node]))
        apart = []
        for child in own:
            for shorter in reversed(apart):
                if distance_to_segment(places[shorter], places[node], places[child]) < SAME_PLACE_PX:
                    children[shorter].append(child)
                    break
            else:
                apart.append(child)
        children[node] = apart
        if parent < 0 or len(apart) != 1:
            kept.append(node)
            below.append(parent)
            parent = len(kept) - 1
        waiting.extend((child, parent) for child in reversed(apart))
    return places[kept], below


def ratios(places, parents):
    """One row a bifurcation and mirror image: angles and lengths as shares."""
    children = {}
    for i, parent in enumerate(parents):
        children.setdefault(parent, []).append(i)
    rows = []
    for i, parent in enumerate(parents):
        own = children.get(i, [])
        if parent < 0 or len(own) < 2:
            continue
        down = places[parent] - places[i]
        branches = []
        for child in own:
            way = places[child] - places[i]
            angle = math.atan2(down[0] * way[1] - down[1] * way[0], np.dot(down, way))
            branches.append((angle % (2 * math.pi), np.linalg.norm(way)))
        branches.sort()
        for left, right in zip(branches, branches[1:]):
            lengths = np.array([np.linalg.norm(down), left[1], right[1]])
            if lengths.min() <= 1e-6 * lengths.sum():
                continue
            lengths /= lengths.sum()
            a, b = left[0] / (2 * math.pi), right[0] / (2 * math.pi)
            rows.append((a, b - a, lengths[0], lengths[1]))
            rows.append((1 - b, b - a, lengths[0], lengths[2]))
    return np.array(rows).reshape(-1, 4)


def ks(a, b):
    both = np.sort(np.concatenate([a, b]))
    shares = [np.searchsorted(np.sort(x), both, side="right") / len(x) for x in (a, b)]
    return np.abs(shares[0] - shares[1]).max()


def line(name, of_example, others):
    n, m = len(of_example) / 2, len(others) / 2
    critical = 1.628 * math.sqrt((n + m) / (n * m))
    distances = [ks(of_example[:, k], others[:, k]) for k in range(4)]
    told = sum(d > critical for d in distances)
    figures = "  ".join(f"{ratio} {d:.2f}" for ratio, d in zip(RATIOS, distances))
    print(f"{name:16} {figures}  critical {critical:.2f}  told apart {told} of 4")


def region_of(folder):
    outline = json.loads((folder / "capture.json").read_text(encoding="utf-8"))["outline"]
    polygon = outline.get("rest_polygon_px") or outline["polygon_px"]
    mask = Image.new("L", (outline["width"], outline["height"]), 0)
    ImageDraw.Draw(mask).polygon([tuple(p) for p in polygon], fill=1)
    v, u = np.nonzero(np.array(mask))
    step = max(1, len(u) // 1500)
    return np.stack([u, v], axis=1)[::step].astype(float)


def along_branches(places, parents):
    points = [places[:1]]
    for i, parent in enumerate(parents):
        if parent >= 0:
            count = max(1, int(np.linalg.norm(places[i] - places[parent]) / 4))
            share = np.arange(1, count + 1)[:, None] / count
            points.append(places[parent] + (places[i] - places[parent]) * share)
    return np.concatenate(points)


def distance(region, points):
    """Mean distance of places from the nearest of some points, px."""
    return np.sqrt(((region[:, None] - points[None]) ** 2).sum(2).min(1)).mean()


def apart(a, b):
    """How far two trees are from each other (chamfer), px."""
    return 0.5 * (distance(a, b) + distance(b, a))


def main():
    example, trees = Path(sys.argv[1]), sorted(Path(sys.argv[2]).iterdir())
    places, parents = fork_tree(*nodes_of(example))
    own = ratios(places, parents)
    grown = [fork_tree(*nodes_of(tree)) for tree in trees]
    height = places[0][1] - places[:, 1].min()
    print(f"{example.name}: {len(own) // 2} forks, {len(trees)} trees of {np.mean([len(t[1]) for t in grown]):.0f} "
          f"nodes where the example has {len(parents)}")
    line("grown", own, np.concatenate([ratios(*tree) for tree in grown]))
    random = np.random.default_rng(1)
    for share in JITTER:
        jittered = []
        for _ in range(JITTERED):
            moved = places + random.normal(0.0, share * height, places.shape)
            moved[0] = places[0]
            jittered.append((moved, parents))
        line(f"moved by {share:.0%}", own, np.concatenate([ratios(*tree) for tree in jittered]))
    region = region_of(example)
    points = [along_branches(*tree) for tree in grown]
    filled = [distance(region, p) for p in points]
    print(f"distance from wood: example {distance(region, along_branches(places, parents)):.1f} px, "
          f"grown {np.median(filled):.1f} px (median)")
    pairs = [apart(a, b) for a, b in zip(points[:60], points[1:61])]
    moved = along_branches(*jittered[0])
    print(f"two trees are {np.median(pairs) / height:.3f} of the height apart (least {min(pairs) / height:.3f}); "
          f"example and moved by {JITTER[-1]:.0%}: {apart(along_branches(places, parents), moved) / height:.3f}")


if __name__ == "__main__":
    main()
