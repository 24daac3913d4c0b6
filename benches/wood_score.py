#!/usr/bin/env python3
"""How well the wood of a captured model agrees with the wood of the film, whose truth is known.

  wood_score.py FILM_DIR CAPTURE_DIR [--json] [--picture FILE.png]

FILM_DIR is a folder as made_films.py writes it (truth.json, wood.png, ...), CAPTURE_DIR what `arborcam replay` wrote.
What was seen is of kind measured, traced or shoot in nodes.csv; the edge from a node to its parent is of the node's kind.
Films in wind are never at rest: there the mean pose is the truth, too, and its figures have `_mean` in their names.

  iou            silhouette of the seen skeleton against the wood that is seen at rest, shared pixels by all of either.
                 Measured and traced edges alone, each as a capsule of its node's radius. A bare film only: behind leaves the
                 model shall have wood that is not seen. Without wood.png the true branches are drawn in the same way
  iou_glb        the same of all that tree.glb draws but leaves, copies included, in the front view
  radius_err     median over the seen length of |r / truth - 1|, by the nearest true branch in sight within 4 px and 30 degrees
  radius_bias    median of r / truth there; 1 is right
  on_wood        share of the seen edges' length with a true branch within 4 px that runs within 30 degrees of it
  covered        share of the true branches' length with a seen edge within 4 px and 30 degrees
  hairpins       share of seen joints that turn by more than 90 degrees in the picture
  turns          the same in space, for each kind of node, and of how many joints
  side_fullness  least area of the whole model's silhouette over all directions of view, 15 degrees apart, by the front's
  quarters       share of the drawn points around the trunk towards front, right, back and left
  wood_mask      precision and recall of the mask in the capture's wood.png, by how much of each pixel shows wood; leaf_mask: of
                 leaves.png
  wood_sure      how much wood the pixels have, inside of the region looked at, whose stated probability is 0 to 0.2, 0.2 to 0.4,
                 ... 0.8 to 1, each after the mean of what is stated; leaf_sure: of leaves
  nodes, seen_px how many nodes of each kind, and the length of seen edges

True branches are those whose mean radius is 0.7 px or more: thinner ones cannot be told from noise. Joints count whose two
pieces are longer than 3 px. A moved camera: places are held against the truth as the first frame shows it.
Needs numpy, scipy and opencv-python-headless.
"""
import argparse, csv, json, struct
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

SEEN, OUTLINED = ("measured", "traced", "shoot"), ("measured", "traced")
NEAR_PX, ALONG_DEG, TURN_DEG, SHORTEST_PX, THINNEST_PX = 4.0, 30.0, 90.0, 3.0, 0.7
FINE, SHIFT = 4, 4
VIEWS_DEG = range(0, 180, 15)
MASKS, MOST_OUTSIDE = {"wood": "wood.png", "leaf": "leaves.png"}, 127
PROBABILITIES = np.linspace(0, 1, 6)


@dataclass
class Line:
    """Points about a pixel apart on many pieces of line: place, direction and radius."""
    at_px: np.ndarray
    along: np.ndarray
    radius_px: np.ndarray


class Film:
    def __init__(self, folder):
        self.truth = json.loads((folder / "truth.json").read_text())
        self.size = self.truth["width"], self.truth["height"]
        self.branches = [b for b in self.truth["branches"] if self.mean_radius_px(b) >= THINNEST_PX]
        self.is_bare = not self.truth["motion"].get("leaf_flutter_rad")
        self.folder = folder

    def mean_radius_px(self, branch):
        return 0.5 * (branch["radius_base"] + branch["radius_tip"]) * self.truth["camera"]["px_per_m_at_z0"]

    def polyline_px(self, branch, shape):
        camera, (width, height) = self.truth["camera"], self.size
        points_m = np.array(branch[shape], float)
        scale = np.full(len(points_m), camera["px_per_m_at_z0"])
        if camera["type"].startswith("persp"):
            scale *= camera["distance_m"] / (camera["distance_m"] - points_m[:, 2])
        u = width / 2 - 0.5 + scale * (points_m[:, 0] - camera["center_xy"][0])
        v = height / 2 - 0.5 - scale * (points_m[:, 1] - camera["center_xy"][1])
        return self.first_frame(np.stack([u, v], axis=-1))

    def first_frame(self, places_px):
        moved = self.truth.get("camera_motion")
        if not moved:
            return places_px
        roll, middle = np.radians(moved["roll_deg"][0]), np.array(self.size) / 2 - 0.5
        turn = np.array([[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]])
        return (places_px - middle) @ turn.T + middle + (moved["dx_px"][0], moved["dy_px"][0])

    def radii_px(self, branch):
        """At each point of the polyline."""
        if "rest_radius_px" in branch:
            return np.array(branch["rest_radius_px"])
        steps = np.linalg.norm(np.diff(np.array(branch["rest_polyline"], float), axis=0), axis=1)
        frac = np.r_[0, np.cumsum(steps)] / max(steps.sum(), 1e-9)
        radius_m = branch["radius_base"] + (branch["radius_tip"] - branch["radius_base"]) * frac
        return radius_m * self.truth["camera"]["px_per_m_at_z0"]

    def line(self, shape):
        return joined([sampled(self.polyline_px(b, shape), self.radii_px(b)) for b in self.branches])

    def line_in_sight(self, shape):
        """Without the pieces between points of which one is hidden at rest, where the truth tells that."""
        pieces = []
        for b in self.branches:
            places, radii = self.polyline_px(b, shape), self.radii_px(b)
            seen = np.array(b.get("rest_seen", np.ones(len(places))), bool)
            pieces += [sampled(places[k : k + 2], radii[k : k + 2]) for k in np.flatnonzero(seen[:-1] & seen[1:])]
        return joined(pieces)

    def wood(self, suffix):
        if (self.folder / f"wood{suffix}.png").is_file():
            return read_mask(self.folder / f"wood{suffix}.png")
        capsules = []
        for b in self.branches:
            places, radii = self.polyline_px(b, "rest_polyline"), self.radii_px(b)
            capsules += [(p, q, r) for p, q, r in zip(places[:-1], places[1:], 0.5 * (radii[:-1] + radii[1:]))]
        return drawn(capsules, self.size)


class Capture:
    def __init__(self, folder):
        with open(folder / "nodes.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.folder, self.rows = folder, {r["node_id"]: r for r in rows}
        self.place_px = {k: np.array([float(r["u_px"]), float(r["v_px"])]) for k, r in self.rows.items()}
        self.place = {k: np.array([float(r[axis]) for axis in "xyz"]) for k, r in self.rows.items()}
        self.px = pixel_of(self.place, self.place_px)

    def edges(self, kinds):
        return [(p, k) for p, k in self.all_edges() if self.rows[k]["kind"] in kinds]

    def all_edges(self):
        return [(r["parent_id"], k) for k, r in self.rows.items() if r["parent_id"]]

    def radius_px(self, node):
        return float(self.rows[node]["radius"]) / self.px

    def line(self):
        pieces = []
        for parent, node in self.edges(SEEN):
            ends = np.stack([self.place_px[parent], self.place_px[node]])
            pieces.append(sampled(ends, np.full(2, self.radius_px(node))))
        return joined(pieces)

    def silhouette(self, size):
        capsules = [(self.place_px[p], self.place_px[k], self.radius_px(k)) for p, k in self.edges(OUTLINED)]
        return drawn(capsules, size)

    def joints(self, place):
        """(node, angle in degrees) of each joint of two pieces that are long enough, at `place` of the nodes."""
        found, shortest = [], SHORTEST_PX * (self.px if place is self.place else 1.0)
        for parent, node in self.all_edges():
            carrier = self.rows[parent]["parent_id"]
            if not carrier:
                continue
            before, after = place[parent] - place[carrier], place[node] - place[parent]
            lengths = np.linalg.norm(before), np.linalg.norm(after)
            if min(lengths) > shortest:
                cosine = np.clip(before @ after / lengths[0] / lengths[1], -1, 1)
                found.append((node, np.degrees(np.arccos(cosine))))
        return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("film_dir", type=Path)
    parser.add_argument("capture_dir", type=Path)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=Path, help="wood of both: white shared, red the film's alone, blue the model's alone")
    args = parser.parse_args()
    film, capture = Film(args.film_dir), Capture(args.capture_dir)
    told = figures(film, capture)
    if args.picture:
        cv2.imwrite(str(args.picture), compared(film.wood(""), capture.silhouette(film.size)))
    print(json.dumps(told) if args.json else "\n".join(f"{name:<14} {shown(value)}" for name, value in told.items()))


def figures(film, capture):
    mesh = Mesh(capture)
    seen = capture.line()
    told = {}
    suffixes = [""] + (["_mean"] if "mean_polyline" in film.branches[0] else [])
    for suffix in suffixes:
        shape = "mean_polyline" if suffix else "rest_polyline"
        true = film.line(shape)
        if film.is_bare:
            told["iou" + suffix] = iou(capture.silhouette(film.size), film.wood(suffix))
            told["iou_glb" + suffix] = iou(mesh.front(film.size), film.wood(suffix))
        told["on_wood" + suffix] = share_near(seen, true)
        told["covered" + suffix] = share_near(true, seen)
        ratio = radius_ratios(seen, film.line_in_sight(shape))
        told["radius_err" + suffix] = float(np.median(np.abs(ratio - 1))) if len(ratio) else None
        told["radius_bias" + suffix] = float(np.median(ratio)) if len(ratio) else None
        told |= {name + suffix: value for name, value in mask_figures(film, capture, suffix).items()}
    flat = [angle for node, angle in capture.joints(capture.place_px) if capture.rows[node]["kind"] in SEEN]
    told["hairpins"] = share_above(flat)
    told["turns"] = {}
    by_kind = {}
    for node, angle in capture.joints(capture.place):
        by_kind.setdefault(capture.rows[node]["kind"], []).append(angle)
    for kind, angles in sorted(by_kind.items()):
        told["turns"][kind] = [share_above(angles), len(angles)]
    told["side_fullness"] = mesh.side_fullness()
    told["quarters"] = mesh.quarters()
    told["nodes"] = dict(Counter(r["kind"] for r in capture.rows.values()))
    told["seen_px"] = len(seen.at_px)
    return told


def pixel_of(places, places_px):
    """Length of a pixel in the model's unit: that of a model without scale is 1."""
    x, u = np.array([p[0] for p in places.values()]), np.array([p[0] for p in places_px.values()])
    return float(np.ptp(x) / np.ptp(u)) if np.ptp(u) > 0 else 1.0


def sampled(points_px, radii_px):
    at, along, radius = [], [], []
    for p, q, r0, r1 in zip(points_px[:-1], points_px[1:], radii_px[:-1], radii_px[1:]):
        length = np.hypot(*(q - p))
        if length < 1e-9:
            continue
        count = max(1, round(length))
        frac = (np.arange(count) + 0.5) / count
        at.append(p + frac[:, None] * (q - p))
        along.append(np.tile((q - p) / length, (count, 1)))
        radius.append(r0 + (r1 - r0) * frac)
    return Line(*(np.concatenate(x) if x else np.zeros((0, 2)[: y]) for x, y in ((at, 2), (along, 2), (radius, 1))))


def joined(lines):
    lines = lines or [Line(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))]
    return Line(*(np.concatenate([getattr(line, name) for line in lines]) for name in Line.__annotations__))


def nearest_alike(line, other):
    """Of each point of a line the nearest point of the other that is near and runs alike, or -1."""
    if not len(other.at_px) or not len(line.at_px):
        return np.full(len(line.at_px), -1)
    found = []
    for i, near in enumerate(cKDTree(other.at_px).query_ball_point(line.at_px, NEAR_PX)):
        near = np.array(near, int)
        alike = near[np.abs(other.along[near] @ line.along[i]) >= np.cos(np.radians(ALONG_DEG))]
        away = np.linalg.norm(other.at_px[alike] - line.at_px[i], axis=1)
        found.append(alike[away.argmin()] if len(alike) else -1)
    return np.array(found)


def share_near(line, other):
    return float((nearest_alike(line, other) >= 0).mean()) if len(line.at_px) else None


def radius_ratios(seen, true):
    nearest = nearest_alike(seen, true)
    return seen.radius_px[nearest >= 0] / true.radius_px[nearest[nearest >= 0]]


def share_above(angles_deg):
    return float(np.mean(np.array(angles_deg) > TURN_DEG)) if angles_deg else None


def drawn(capsules, size):
    """(height, width) bool: pixels of which the capsules (end, end, radius) cover half."""
    canvas = np.zeros((FINE * size[1], FINE * size[0]), np.uint8)
    for p, q, radius in capsules:
        along = q - p
        side = np.array([-along[1], along[0]]) * radius / max(np.hypot(*along), 1e-9)
        cv2.fillConvexPoly(canvas, fixed(np.stack([p + side, q + side, q - side, p - side])), 255, cv2.LINE_8, SHIFT)
        for end in (p, q):
            cv2.circle(canvas, fixed(end[None])[0], round(radius * FINE * (1 << SHIFT)), 255, -1, cv2.LINE_8, SHIFT)
    return cv2.resize(canvas, size, interpolation=cv2.INTER_AREA) >= 128


def fixed(places_px):
    # The fine pixel k covers (k - 0.5 .. k + 0.5), of which FINE lie in one pixel of the film.
    return np.round(((places_px + 0.5) * FINE - 0.5) * (1 << SHIFT)).astype(np.int32)


def read_mask(path):
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) >= 128


def iou(mask, other):
    either = (mask | other).sum()
    return float((mask & other).sum() / either) if either else None


def mask_figures(film, capture, suffix):
    told, files = {}, [(film.folder / Path(name).with_stem(Path(name).stem + suffix), capture.folder / name) for name in MASKS.values()]
    if not all(file.is_file() for pair in files for file in pair):
        return told
    shares, stated = ([cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) / 255 for file in side] for side in zip(*files))
    is_looked_at = (stated[0] > 0) | (stated[1] > 0)
    for name, share, said in zip(MASKS, shares, stated):
        is_in = said > MOST_OUTSIDE / 255
        told[name + "_mask"] = [float(share[is_in].mean()) if is_in.any() else None, float(share[is_in].sum() / max(share.sum(), 1))]
        told[name + "_sure"] = []
        for low, high in zip(PROBABILITIES[:-1], PROBABILITIES[1:]):
            there = is_looked_at & (said >= low) & ((said < high) | (high == 1))
            told[name + "_sure"] += [[float(x[there].mean()) for x in (said, share)] if there.any() else None]
    return told


class Mesh:
    """What tree.glb draws at rest: triangles in the model's axes."""

    def __init__(self, capture):
        self.capture = capture
        data = (capture.folder / "tree.glb").read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        note, body = json.loads(data[20 : 20 + length]), data[28 + length :]
        self.wood, self.leaves = [], []
        for mesh in note["meshes"]:
            for part in mesh["primitives"]:
                places = accessor(note, body, part["attributes"]["POSITION"])
                corners = accessor(note, body, part["indices"]).reshape(-1, 3) if "indices" in part else \
                    np.arange(len(places)).reshape(-1, 3)
                is_leaf = "lea" in note["materials"][part["material"]].get("name", "")
                (self.leaves if is_leaf else self.wood).append(places[corners.astype(int)])
        root = next(k for k, r in capture.rows.items() if not r["parent_id"])
        self.foot_px = capture.place_px[root] - np.array([1, -1]) * capture.place[root][:2] / capture.px

    def front(self, size, leaves=False):
        """(height, width) bool: pixels of which half is covered, by wood or also by leaves."""
        canvas = np.zeros((FINE * size[1], FINE * size[0]), np.uint8)
        for triangles in self.wood + (self.leaves if leaves else []):
            places = self.foot_px + np.array([1, -1]) * triangles[..., :2] / self.capture.px
            for corners in fixed(places):
                cv2.fillConvexPoly(canvas, corners, 255, cv2.LINE_8, SHIFT)
        return cv2.resize(canvas, size, interpolation=cv2.INTER_AREA) >= 128

    def area(self, turn_deg):
        """Pixels that the model covers, seen from this azimuth."""
        turn = np.radians(turn_deg)
        places = np.concatenate(self.wood + self.leaves) / self.capture.px
        flat = np.stack([np.cos(turn) * places[..., 0] + np.sin(turn) * places[..., 2], -places[..., 1]], axis=-1)
        low, high = np.floor(flat.min(axis=(0, 1))), np.ceil(flat.max(axis=(0, 1)))
        width, height = ((high - low + 1) * FINE).astype(int)
        canvas = np.zeros((height, width), np.uint8)
        for corners in fixed(flat - low):
            cv2.fillConvexPoly(canvas, corners, 255, cv2.LINE_8, SHIFT)
        return np.count_nonzero(canvas) / FINE**2

    def side_fullness(self):
        areas = [self.area(turn) for turn in VIEWS_DEG]
        return min(areas) / areas[0]

    def quarters(self):
        places = np.concatenate(self.wood + self.leaves)
        size = np.linalg.norm(np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]), axis=1)
        middle = places.mean(axis=1)
        azimuth = np.degrees(np.arctan2(middle[:, 0], middle[:, 2]))
        quarter = ((azimuth + 45) // 90).astype(int) % 4
        return [round(float(x), 3) for x in np.bincount(quarter, size, 4) / size.sum()]


def accessor(note, body, index):
    entry = note["accessors"][index]
    view = note["bufferViews"][entry["bufferView"]]
    kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[entry["componentType"]]
    columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[entry["type"]]
    start, size = view.get("byteOffset", 0) + entry.get("byteOffset", 0), columns * np.dtype(kind).itemsize
    stride = view.get("byteStride", size)
    rows = np.lib.stride_tricks.as_strided(np.frombuffer(body, np.uint8, offset=start), (entry["count"], size), (stride, 1))
    return np.ascontiguousarray(rows).view(kind).reshape(entry["count"], columns)


def compared(wood, model):
    picture = np.zeros((*wood.shape, 3), np.uint8)
    picture[wood & ~model], picture[model & ~wood], picture[wood & model] = (60, 60, 230), (230, 130, 40), (255, 255, 255)
    return picture


def shown(value):
    if isinstance(value, dict):
        return "  ".join(f"{k} {shown(v)}" for k, v in value.items())
    if isinstance(value, list):
        return " ".join(shown(v) for v in value)
    return "-" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
