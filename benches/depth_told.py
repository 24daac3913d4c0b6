#!/usr/bin/env python3
"""How well a built arborcam places markers and branches in space by a depth camera, and without one.

  depth_told.py ARBORCAM FILM_DIR... [--out DIR]

Why: Hu et al. (sect. 4) measure trees with a depth camera; a place in space is asked to be within 5 mm at 2 m. FILM_DIR are films of
made_films.py --depth (and --markers). Each is replayed three times, with its depth, with --no-depth and the true scale, and with
its depth and the deterministic pose. One row a film:
  marker mm   distance of a marker's place in space (its pixel and depth through the camera) from the true one, median and 95 %
  depth mm    the part of it along the line of sight, median      seen   share of the places of markers that have a depth
  nodes       measured nodes whose place is compared              with   how far they are from the true branch along the line of sight,
                                                                         from the foot, at rest, % of the tree's height: median with depth
  without     the same without depth
  scale %     error of metres_per_px
  moves mm    how the measured node nearest to each marker (within 12 px in the picture, else none) moves along the line of sight
              against the marker, standard deviation of the difference, median of the markers: with depth, without, deterministic; true: of the markers' own motion
"""
import argparse, csv, json, subprocess, tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

FIRST_ID = 1_000_000_000
NEAR_PX = 6.0
NEAR_MARKER_PX = 12.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arborcam", type=Path)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, help="keeps the captures there")
    args = parser.parse_args()
    args.arborcam = args.arborcam.resolve()
    print(f"{'film':<12}{'marker mm':>10}{'95 %':>7}{'depth mm':>10}{'seen':>7}{'nodes':>7}{'with':>8}{'without':>9}{'scale %':>9}{'moves mm':>10}{'without':>9}{'determ.':>9}{'true':>7}")
    with tempfile.TemporaryDirectory() as work:
        rows = [row(args, film, (args.out or Path(work)) / film.name) for film in args.films]
    for name in ("marker", "depth"):
        all_mm = np.concatenate([r[name] for r in rows])
        if len(all_mm):
            print(f"all films: {name} median {np.median(all_mm):.2f} mm, 95 % {np.quantile(all_mm, 0.95):.2f} mm, {len(all_mm)} places")
    for name in ("with", "without"):
        all_share = np.concatenate([r[name] for r in rows])
        print(f"all films: nodes {name} depth, {len(all_share)}: median {100 * np.median(all_share):.1f} %, 90 % {100 * np.quantile(all_share, 0.9):.1f} % of the height")


def row(args, film, out):
    truth = json.loads((film / "truth.json").read_text())
    camera = truth["camera"]
    scale = 2.0 / camera["focal_px"]
    usual = [args.arborcam, "replay", film, "--outline", film / "outline.json", "--fast", "--headless"]
    if (film / "markers.json").exists():
        usual += ["--markers", film / "markers.json"]
    with_depth, without, deterministic = [out.with_name(f"{out.name}-{how}") for how in ("with", "without", "deterministic")]
    settings = out.with_name("deterministic.toml")
    settings.parent.mkdir(parents=True, exist_ok=True)
    settings.write_text('[motion]\nmethod = "deterministic"\n')
    subprocess.run(usual + ["--out", with_depth], check=True, capture_output=True)
    subprocess.run(usual + ["--out", without, "--no-depth", "--metres-per-px", str(scale)], check=True, capture_output=True)
    subprocess.run(usual + ["--out", deterministic, "--config", settings], check=True, capture_output=True)
    marker_mm, depth_mm, seen = markers(film, with_depth)
    moves = [moves_mm(film, d) for d in (with_depth, without, deterministic)]
    height = max(p[1] for b in truth["branches"] for p in b["rest_polyline"]) * camera["real_metres"]
    at_rest = [node_errors(truth, d) / height for d in (with_depth, without)]
    note = json.loads((with_depth / "capture.json").read_text())
    found = (note.get("depth") or {}).get("metres_per_px", np.nan)
    print(f"{film.name:<12}{med(marker_mm):>10.2f}{quant(marker_mm):>7.2f}{med(depth_mm):>10.2f}{seen:>7.2f}{len(at_rest[0]):>7}"
          f"{100 * med(at_rest[0]):>8.1f}{100 * med(at_rest[1]):>9.1f}"
          f"{100 * (found / scale - 1):>9.2f}{moves[0][0]:>10.2f}{moves[1][0]:>9.2f}{moves[2][0]:>9.2f}{moves[0][1]:>7.2f}", flush=True)
    return {"marker": marker_mm, "depth": depth_mm, "with": at_rest[0], "without": at_rest[1]}


def med(x):
    return np.median(x) if len(x) else np.nan


def quant(x):
    return np.quantile(x, 0.95) if len(x) else np.nan


def markers(film, capture):
    """Distances of places of markers from the truth in space and along the line of sight, mm; share with a depth."""
    if not (film / "truth_markers.json").exists():
        return np.array([]), np.array([]), np.nan
    truth = json.loads((film / "truth_markers.json").read_text())["markers"]
    camera = json.loads((film / "camera.json").read_text())
    rows = defaultdict(list)
    for name in ("tracks.csv", "left_out.csv"):
        with open(capture / name) as f:
            for r in csv.DictReader(f):
                if int(r["track_id"]) >= FIRST_ID:
                    rows[int(r["track_id"]) - FIRST_ID].append(r)
    off, along, places = [], [], 0
    for number, seen in rows.items():
        marker = truth[number]
        for r in seen:
            places += 1
            if not r["depth_m"]:
                continue
            u, v, z = float(r["u_px"]), float(r["v_px"]), float(r["depth_m"])
            place = np.array([(u - camera["cx"]) * z / camera["fx"], (v - camera["cy"]) * z / camera["fy"], z])
            error = place - np.array(marker["places_m"][int(r["frame"])])
            off.append(1000 * np.linalg.norm(error))
            along.append(1000 * abs(error[2]))
    return np.array(off), np.array(along), len(off) / max(places, 1)


def moves_mm(film, capture):
    """Medians of the markers: how far the nearest node's motion along the line of sight is from the marker's, and that motion, mm."""
    if not (film / "truth_markers.json").exists():
        return np.nan, np.nan
    nodes = [n for n in csv.DictReader(open(capture / "nodes.csv")) if n["kind"] == "measured" and n["parent_id"]]
    nodes_px = np.array([[float(n["u_px"]), float(n["v_px"])] for n in nodes])
    depth_m = defaultdict(dict)
    for r in csv.DictReader(open(capture / "motion.csv")):
        depth_m[r["node_id"]][int(r["frame"])] = float(r["z"])
    off, moved = [], []
    for marker in json.loads((film / "truth_markers.json").read_text())["markers"]:
        far = np.linalg.norm(nodes_px - np.mean(marker["places_px"], axis=0), axis=1)
        own = depth_m.get(nodes[int(np.argmin(far))]["node_id"], {})
        frames = [f for f in sorted(own) if f < len(marker["places_m"])]
        if far.min() > NEAR_MARKER_PX or not frames:
            continue
        # The node's z is towards the viewer, the marker's away from it.
        true = -np.array(marker["places_m"])[frames, 2]
        off.append(1000 * np.std(np.array([own[f] for f in frames]) - true))
        moved.append(1000 * np.std(true))
    return med(off), med(moved)


def node_errors(truth, capture):
    """How far each measured node is from the true branch near it along the line of sight, real metres from the foot."""
    camera = truth["camera"]
    points, depths = [], []
    for b in truth["branches"]:
        line = np.array(b["rest_polyline"])
        fine = np.concatenate([a + (b_ - a) * np.linspace(0, 1, 20)[:, None] for a, b_ in zip(line[:-1], line[1:])])
        scale = camera["focal_px"] / (camera["distance"] - fine[:, 2])
        u = truth["width"] / 2 - 0.5 + scale * (fine[:, 0] - camera["centre_xy"][0])
        v = truth["height"] / 2 - 0.5 - scale * (fine[:, 1] - camera["centre_xy"][1])
        points.append(np.stack([u, v], axis=-1))
        depths.append(camera["real_metres"] * fine[:, 2])
    points, depths = np.concatenate(points), np.concatenate(depths)
    errors = []
    with open(capture / "nodes.csv") as f:
        for r in csv.DictReader(f):
            if r["kind"] != "measured" or not r["parent_id"]:
                continue
            at = np.array([float(r["u_px"]), float(r["v_px"])])
            off = np.linalg.norm(points - at, axis=1)
            near = off <= NEAR_PX
            if near.any():
                # Several branches may pass there; the node is on the one that it is nearest to in the picture.
                errors.append(abs(float(r["z"]) - depths[np.argmin(off)]))
    return np.array(errors)


if __name__ == "__main__":
    main()
