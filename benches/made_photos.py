#!/usr/bin/env python3
"""Photographs of made-up trees whose wood, leaves and shape in space are known.

  made_photos.py OUT_DIR NAME SEED leaves|bare [--width PX] [--trees COUNT] [--low-crown]

The trees, the scenery and the drawing are those of made_films.py: one frame, of a tree at rest, in the size of a photograph.
The same seed gives the same photograph. Writes to OUT_DIR/NAME:
  photo.jpg      the photograph, 1500 px wide by default, JPEG
  crown.json     a crown stroke round the leaves, or round the bare tree above its first fork, as drawn by hand
  trunk.json     a branch stroke along the trunk, from the foot up, as drawn by hand
  truth.json     camera (orthographic), and of each branch the parent, rest shape (m), radius at each point (px), whether it is
                 seen there
  wood.png       how much of each pixel shows wood, 0 to 255; leaves.png: the same of leaves

With --trees it is a photograph of several trees, one behind the other, each in its size by its distance:
  tree-1.json    crown and trunk stroke of the nearest tree, and so on
  truth.json     the row of the horizon, and of each tree the foot (px), the distance (1: the nearest) and the height (m)
  wood.png, leaves.png  of all trees
With --low-crown the crown stroke takes in what lies below the crown, down to the middle of the trunk, or to a lawn.

Needs numpy, scipy and opencv-python-headless. About 10 s of one core for each tree.
"""
import argparse, json
from pathlib import Path

import cv2
import numpy as np

from made_films import picture

JPEG_QUALITY = 92
UNSTEADY_PX = 2.0  # how far a hand is off the line that it follows, at 1500 px width
# Gaps of a crown that a stroke leads round, px at 640 px width, and the share of the crown that it takes in at least.
CROWN_GAPS = [41, 61, 91, 131, 181]
CROWN_SHARE = 0.97


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out_dir", type=Path)
    parser.add_argument("name")
    parser.add_argument("seed", type=int)
    parser.add_argument("look", choices=["leaves", "bare"])
    parser.add_argument("--width", type=int, default=1500)
    parser.add_argument("--trees", type=int)
    parser.add_argument("--low-crown", action="store_true")
    args = parser.parse_args()
    picture.enlarge(args.width / picture.WIDTH)
    if args.trees:
        make_wood(args.out_dir / args.name, args.seed, args.look == "leaves", args.trees)
    else:
        make(args.out_dir / args.name, args.seed, args.look == "leaves", args.low_crown)


def make(folder, seed, leafy, low):
    # They take the size of the picture when they are loaded.
    from made_films import motion, scenery, surface, tree, truth

    rng = np.random.default_rng(seed)
    branches, _ = tree.grow(rng, leafy)
    rest = motion.Pose(branches, np.zeros((1, len(branches), 2)))
    camera = picture.Camera.framing(rng, rest.points_m)
    skin = surface.without_flutter(surface.cover(rng, branches, rest, leafy))
    small = scenery.scenery(rng, leafy, picture.FILM_WIDTH, picture.FILM_HEIGHT)
    background = cv2.resize(small, (picture.WIDTH, picture.HEIGHT), interpolation=cv2.INTER_CUBIC)
    seen = truth.facet_map(skin, rest, camera, np.zeros((picture.FINE * picture.HEIGHT, picture.FINE * picture.WIDTH), bool))
    facts = truth.widths(branches, skin, rest, camera, seen)
    film = dict(clip=folder.name, renderer="benches/made_photos.py", tree=f"made up, seed {seed}", width=picture.WIDTH,
                height=picture.HEIGHT, coordinates=truth.COORDINATES, camera=truth.of_camera(camera),
                motion=dict(leaf_flutter_rad=1.0 if leafy else 0.0),
                branches=truth.of_branches(branches, rest, camera, np.zeros(0, int), facts))

    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / "photo.jpg"), photograph(rng, background, [(skin, rest, camera)]),
                [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    for name, mask in zip(["wood.png", "leaves.png"], truth.masks(skin, seen)):
        cv2.imwrite(str(folder / name), mask)
    leaves = (seen >= 0) & skin.two_sided[seen]
    (folder / "crown.json").write_text(json.dumps(crown(leaves if leafy else seen >= 0, branches, camera, low)))
    (folder / "trunk.json").write_text(json.dumps(trunk(rng, branches, camera)))
    (folder / "truth.json").write_text(json.dumps(film))


FARTHEST = 2.2  # how far the last tree of a wood is, by the nearest
HORIZON = 0.70  # the horizon of a wood, by the height of the picture
FOOT_V = 0.93  # the nearest foot, by the same


def make_wood(folder, seed, leafy, count):
    from made_films import motion, scenery, surface, tree, truth

    rng = np.random.default_rng(seed)
    small = scenery.scenery(rng, leafy, picture.FILM_WIDTH, picture.FILM_HEIGHT)
    background = cv2.resize(small, (picture.WIDTH, picture.HEIGHT), interpolation=cv2.INTER_CUBIC)
    horizon = HORIZON * picture.HEIGHT
    distances = np.linspace(1, FARTHEST, count) if count > 1 else np.ones(1)
    columns = (0.1 + 0.8 * (rng.permutation(count) + 0.5 + rng.uniform(-0.15, 0.15, count)) / count) * picture.WIDTH
    trees, folder_facts = [], []
    covered = dict.fromkeys(["wood.png", "leaves.png"], np.zeros((picture.HEIGHT, picture.WIDTH), np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    for k, (distance, column) in enumerate(zip(distances, columns)):
        branches, _ = tree.grow(rng, leafy)
        rest = motion.Pose(branches, np.zeros((1, len(branches), 2)))
        foot = (column, horizon + (FOOT_V * picture.HEIGHT - horizon) / distance)
        largest = (FOOT_V * picture.HEIGHT - picture.MARGIN_PX) / rest.points_m[..., 1].max()
        camera = standing(foot, min(largest, 1.6 * picture.WIDTH / count / np.ptp(rest.points_m[..., 0])) / distance)
        skin = surface.without_flutter(surface.cover(rng, branches, rest, leafy))
        trees.append((skin, rest, camera))
        seen = truth.facet_map(skin, rest, camera, np.zeros((picture.FINE * picture.HEIGHT, picture.FINE * picture.WIDTH), bool))
        # The nearest comes first, and hides those behind it.
        free = 255 - sum(mask.astype(int) for mask in covered.values()).clip(0, 255)
        for name, mask in zip(covered, truth.masks(skin, seen)):
            covered[name] = covered[name] + (mask * (free / 255)).astype(np.uint8)
        leaves = (seen >= 0) & skin.two_sided[seen]
        drawn = crown(leaves if leafy else seen >= 0, branches, camera) | dict(strokes=[trunk(rng, branches, camera)])
        drawn["strokes"][0] = dict(polyline_px=drawn["strokes"][0]["polyline_px"], trunk=True)
        (folder / f"tree-{k + 1}.json").write_text(json.dumps(drawn))
        folder_facts.append(dict(foot_px=list(foot), distance=float(distance), height_m=float(rest.points_m[..., 1].max()),
                                 px_per_m=camera.px_per_m))
    cv2.imwrite(str(folder / "photo.jpg"), photograph(rng, background, trees[::-1]), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    for name, mask in covered.items():
        cv2.imwrite(str(folder / name), mask)
    (folder / "truth.json").write_text(json.dumps(dict(width=picture.WIDTH, height=picture.HEIGHT, horizon_px=horizon,
                                                       trees=folder_facts)))


def standing(foot_px, px_per_m):
    """The camera that sees a tree's foot there."""
    u, v = foot_px
    centre = (-(u - picture.WIDTH / 2 + 0.5) / px_per_m, (v - picture.HEIGHT / 2 + 0.5) / px_per_m)
    return picture.Camera(float(px_per_m), tuple(map(float, centre)))


def photograph(rng, background, trees):
    """(height, width, 3) bytes, blue green red; the nearest tree comes last."""
    canvas = picture.fine_canvas(background)
    for skin, pose, camera in trees:
        colours = [tuple(map(float, c)) for c in np.clip(skin.colour, 0, 255)]
        picture.draw(canvas, skin, skin.vertices_m(pose, 0, 0.0), camera, colours)
    image = cv2.resize(canvas, (picture.WIDTH, picture.HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32)
    image += rng.normal(0, picture.NOISE_SIGMA, image.shape)
    return np.clip(image + 0.5, 0, 255).astype(np.uint8)


def crown(seen, branches, camera, low=False):
    """A crown stroke: the leaves, or the bare tree above its first fork, with a margin; a low one down to the lawn."""
    tree = cv2.resize(seen.astype(np.uint8), (picture.WIDTH, picture.HEIGHT), interpolation=cv2.INTER_AREA)
    forks = [b.nodes_m[0] for b in branches if b.parent == 0]
    low_v = max(camera.project(np.array(forks))[:, 1])
    tree[int(low_v) :] = 0
    if low:
        u, v = np.flatnonzero(tree.any(axis=0)), np.flatnonzero(tree.any(axis=1))
        foot_v = camera.project(branches[0].nodes_m)[0, 1]
        tree[v[-1] : int(v[-1] + 0.8 * (foot_v - v[-1])), u[0] + len(u) // 4 : u[-1] - len(u) // 4] = 1
    px = picture.WIDTH / 640
    disc = lambda d: cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (int(d * px) | 1, int(d * px) | 1))
    # Parts of a crown that stand apart are in one stroke.
    for gap in CROWN_GAPS:
        pad = int(gap * px)
        wide = cv2.copyMakeBorder(tree, pad, pad, pad, pad, cv2.BORDER_CONSTANT)
        wide = cv2.erode(cv2.dilate(wide, disc(gap)), disc(gap - 14))[pad:-pad, pad:-pad]
        contours, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        largest = max(contours, key=cv2.contourArea)
        inside = cv2.fillPoly(np.zeros_like(tree), [largest], 1)
        if (tree & inside).sum() >= CROWN_SHARE * tree.sum():
            break
    polygon = cv2.approxPolyDP(largest, 3.0 * px, True)[:, 0]
    return {"width": picture.WIDTH, "height": picture.HEIGHT, "polygon_px": polygon.tolist()}


def trunk(rng, branches, camera):
    """A branch stroke along the trunk."""
    line_px = camera.project(branches[0].nodes_m)
    line_px += rng.normal(0, UNSTEADY_PX * picture.WIDTH / 1500, line_px.shape)
    return {"width": picture.WIDTH, "height": picture.HEIGHT, "polyline_px": np.round(line_px, 1).tolist()}


if __name__ == "__main__":
    main()
