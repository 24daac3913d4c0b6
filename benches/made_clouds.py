#!/usr/bin/env python3
"""Point clouds of made-up trees whose true wood is known, as a laser scanner on a few tripods gives them.

  made_clouds.py OUT_DIR NAME SEED [--leaves] [--no-ground] [--scanners N] [--step DEG] [--noise MM] [--format ply|xyz]

Why: a tree from a cloud can be scored only against one that is known. The tree of a seed is the one that made_films.py films
with the same seed, so that a film can be laid on the scan.

Writes to OUT_DIR/NAME:
  cloud.ply (or cloud.xyz)   points, m, z up, turned and shifted by chance as surveys are
  owner.npy                  of each point the number of its branch, -1 on a leaf, -2 on the ground
  truth.json                 of each branch parent, centre line (m, in the cloud's axes), radius at each of its places, points on
                             it, Hz, damping; the foot; how the film's axes lie in those of the cloud

A tree is tapered tubes round crooked lines. Each scanner sends rays at an even step of angle, and each ray gives the first
surface that it meets (samples of the surface, a depth buffer of directions), with noise along the ray and half of it
across. Needs numpy.
"""
import argparse, json
from pathlib import Path

import numpy as np

from made_films import tree

SCANNER_HEIGHT_M = 1.5
DISTANCE_M = (4.5, 7.0)
SAMPLES_PER_M2 = 120_000.0
LEAVES = 2600
GROUND_RADIUS_M = 2.5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out_dir", type=Path)
    parser.add_argument("name")
    parser.add_argument("seed", type=int)
    parser.add_argument("--leaves", action="store_true")
    parser.add_argument("--no-ground", action="store_true")
    parser.add_argument("--scanners", type=int)
    parser.add_argument("--step", type=float, default=0.1, help="between two rays, degrees")
    parser.add_argument("--noise", type=float, help="standard deviation along the ray, mm; 2 to 5 by chance")
    parser.add_argument("--format", choices=["ply", "xyz"], default="ply")
    args = parser.parse_args()
    make(args.out_dir / args.name, args)


def make(folder, args):
    branches, _ = tree.grow(np.random.default_rng(args.seed), args.leaves)
    rng = np.random.default_rng([args.seed, 7])
    noise_m = 1e-3 * (args.noise or rng.uniform(2.0, 5.0))
    scanners = args.scanners or int(rng.integers(3, 5))
    ground = None if args.no_ground else Ground(rng)
    samples, owner = surface(rng, branches)
    if args.leaves:
        green = leaves(rng, branches)
        samples, owner = np.r_[samples, green], np.r_[owner, np.full(len(green), -1)]
    if ground:
        floor = ground.samples(rng)
        samples, owner = np.r_[samples, floor], np.r_[owner, np.full(len(floor), -2)]
    points, owner = scan(rng, samples, owner, scanners, args.step, noise_m)
    azimuth, shift = rng.uniform(0, 2 * np.pi), np.r_[rng.uniform(-400, 400, 2), rng.uniform(80, 300)]
    turn = np.array([[np.cos(azimuth), -np.sin(azimuth), 0], [np.sin(azimuth), np.cos(azimuth), 0], [0, 0, 1]])
    points = points @ turn.T + shift
    folder.mkdir(parents=True, exist_ok=True)
    order = rng.permutation(len(points))
    write(folder / f"cloud.{args.format}", points[order], args.format)
    np.save(folder / "owner.npy", owner[order].astype(np.int16))
    truth = dict(seed=args.seed, leaves=args.leaves, noise_m=noise_m, scanners=scanners, points=len(points),
                 foot=shift.tolist(), turn=turn.tolist(), branches=[
                     dict(id=b.id, parent=b.parent, depth=b.depth, points=int((owner == b.id).sum()),
                          freq_hz=b.freq_hz, damping=b.damping,
                          polyline=np.round(z_up(b.nodes_m) @ turn.T + shift, 5).tolist(),
                          radius=np.round(b.radius_m(np.linspace(0, 1, len(b.nodes_m))), 5).tolist())
                     for b in branches])
    (folder / "truth.json").write_text(json.dumps(truth))


def z_up(places):
    """From x right, y up, z towards the viewer to z up."""
    return np.stack([places[..., 0], -places[..., 2], places[..., 1]], axis=-1)


def surface(rng, branches):
    """Samples of the bark, evenly by area, and the branch of each. What lies inside of another branch is hidden by it."""
    parts, owner = [], []
    for b in branches:
        nodes = z_up(b.nodes_m)
        radius = b.radius_m(np.linspace(0, 1, len(nodes)))
        length = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
        area = 2 * np.pi * 0.5 * (radius[1:] + radius[:-1]) * length
        for k in range(len(length)):
            n = rng.poisson(area[k] * SAMPLES_PER_M2)
            t, angle = rng.random(n), rng.uniform(0, 2 * np.pi, n)
            along = (nodes[k + 1] - nodes[k]) / length[k]
            e1 = np.cross(along, [1.0, 0, 0] if abs(along[0]) < 0.9 else [0, 1.0, 0])
            e1 /= np.linalg.norm(e1)
            e2 = np.cross(along, e1)
            r = radius[k] + (radius[k + 1] - radius[k]) * t
            off = np.cos(angle)[:, None] * e1 + np.sin(angle)[:, None] * e2
            parts.append(nodes[k] + t[:, None] * (nodes[k + 1] - nodes[k]) + r[:, None] * off)
            owner.append(np.full(n, b.id))
    samples, owner = np.concatenate(parts), np.concatenate(owner)
    return samples, owner


def leaves(rng, branches):
    share = np.array([b.length_m * (0.3, 0.5, 0.9, 0.9, 0.9)[b.depth] for b in branches])
    parts = []
    for b, count in zip(branches, rng.multinomial(LEAVES, share / share.sum())):
        for _ in range(count):
            point, _ = b.at(1 - 0.9 * rng.random())
            middle = z_up(point) + rng.normal(0, 0.08, 3)
            across = rng.normal(0, 1, (2, 3))
            across /= np.linalg.norm(across, axis=1)[:, None]
            flat = rng.uniform(-0.5, 0.5, (800, 2)) * [0.08, 0.06]
            parts.append(middle + flat @ across)
    return np.concatenate(parts)


class Ground:
    """A gentle slope with bumps."""

    def __init__(self, rng):
        self.slope, self.phase = rng.uniform(-0.1, 0.1, 2), rng.uniform(0, 2 * np.pi, 2)

    def height(self, x, y):
        bumps = 0.03 * (np.sin(2 * x + self.phase[0]) + np.sin(1.7 * y + self.phase[1]))
        at_foot = 0.03 * (np.sin(self.phase[0]) + np.sin(self.phase[1]))
        return self.slope[0] * x + self.slope[1] * y + bumps - at_foot

    def samples(self, rng):
        n = 600_000
        r, angle = GROUND_RADIUS_M * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
        x, y = r * np.cos(angle), r * np.sin(angle)
        return np.stack([x, y, self.height(x, y) + rng.exponential(0.008, n)], axis=1)


def scan(rng, samples, owner, scanners, step_deg, noise_m):
    """What rays from the scanners' places meet first."""
    points, owners, first = [], [], rng.uniform(0, 2 * np.pi)
    for k in range(scanners):
        angle = first + 2 * np.pi * k / scanners + rng.normal(0, 0.15)
        at = np.array([*(rng.uniform(*DISTANCE_M) * np.array([np.cos(angle), np.sin(angle)])), SCANNER_HEIGHT_M])
        way = samples - at
        far = np.linalg.norm(way, axis=1)
        step = np.radians(step_deg)
        row = np.floor(np.arcsin(way[:, 2] / far) / step).astype(np.int64)
        column = np.floor(np.arctan2(way[:, 1], way[:, 0]) / step).astype(np.int64)
        cell = (row + 100_000) * 1_000_000 + column + 100_000
        order = np.lexsort((far, cell))
        seen = order[np.r_[True, np.diff(cell[order]) != 0]]
        ray = way[seen] / far[seen][:, None]
        met = samples[seen] + rng.normal(0, noise_m, len(seen))[:, None] * ray
        points.append(met + rng.normal(0, 0.5 * noise_m, met.shape))
        owners.append(owner[seen])
    return np.concatenate(points), np.concatenate(owners)


def write(path, points, form):
    if form == "xyz":
        np.savetxt(path, points, fmt="%.4f")
        return
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + points.astype("<f8").tobytes())


if __name__ == "__main__":
    main()
