#!/usr/bin/env python3
"""Point clouds of made-up trees whose true wood is known, as a laser scanner on a few tripods gives them.

  made_clouds.py OUT_DIR NAME SEED [--leaves] [--trees N [--apart M]] [--no-ground] [--scanners N] [--step DEG] [--noise MM] [--format ply|xyz]
                 [--treefile FILE] [--even POINTS]

Why: a tree from a cloud can be scored only against one that is known. The tree of a seed is the one that made_films.py films
with the same seed, so that a film can be laid on the scan.

Writes to OUT_DIR/NAME:
  cloud.ply (or cloud.xyz)   points, m, z up, turned and shifted by chance as surveys are
  owner.npy                  of each point the number of its branch, -1 on a leaf, -2 on the ground
  tree.npy                   of each point the number of its tree, -1 on the ground
  truth.json                 of each branch parent, centre line (m, in the cloud's axes), radius at each of its places, points on
                             it, Hz, damping; the foot; how the film's axes lie in those of the cloud

A tree is tapered tubes round crooked lines. Each scanner sends rays at an even step of angle, and each ray gives the first
surface that it meets (samples of the surface, a depth buffer of directions), with noise along the ray and half of it
across. Needs numpy.

With --trees N several trees, each turned and 0.6 to 1.2 times as large as the one of its seed (SEED, 1000 SEED + 1, ...), stand on one
plot, no two trunks nearer than --apart: their crowns reach into each other. Then truth.json has a list "trees", each with its foot and
branches, and scanners stand among them, too.

With --even no scanner is there: so many points lie on all surfaces by chance, as photogrammetry and walking scanners give them.

With --treefile the tree is that of a file of another program (`treecreate` of treetools, say), and SEED only places the scanners.
"""
import argparse, json
from pathlib import Path

import numpy as np

import treefile
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
    parser.add_argument("--trees", type=int, default=1)
    parser.add_argument("--apart", type=float, default=2.5, help="least distance of two trunks, m")
    parser.add_argument("--no-ground", action="store_true")
    parser.add_argument("--scanners", type=int)
    parser.add_argument("--step", type=float, default=0.1, help="between two rays, degrees")
    parser.add_argument("--noise", type=float, help="standard deviation along the ray, mm; 2 to 5 by chance")
    parser.add_argument("--format", choices=["ply", "xyz"], default="ply")
    parser.add_argument("--treefile", type=Path)
    parser.add_argument("--even", type=int, metavar="POINTS")
    args = parser.parse_args()
    make(args.out_dir / args.name, args)


def make(folder, args):
    grown = tree.grow(np.random.default_rng(args.seed), args.leaves)[0] if args.treefile is None else treefile.branches(args.treefile)
    trees = [Standing(grown)]
    rng = np.random.default_rng([args.seed, 7])
    noise_m = 1e-3 * (args.noise or rng.uniform(2.0, 5.0))
    scanners = args.scanners or int(rng.integers(3, 5))
    plot_m = 0.0
    if args.trees > 1:
        trees, plot_m = plot(rng, args)
        scanners = args.scanners or 3 + args.trees
    ground = None if args.no_ground else Ground(rng, plot_m)
    samples, owner, of_tree = [], [], []
    for number, one in enumerate(trees):
        if ground and plot_m:
            one.foot[2] = ground.height(*one.foot[:2])
        own, branch = surface(rng, one.branches)
        if args.leaves:
            green = leaves(rng, one.branches)
            own, branch = np.r_[own, green], np.r_[branch, np.full(len(green), -1)]
        samples.append(one.placed(own))
        owner.append(branch)
        of_tree.append(np.full(len(own), number))
    if ground:
        floor = ground.samples(rng)
        samples.append(floor)
        owner.append(np.full(len(floor), -2))
        of_tree.append(np.full(len(floor), -1))
    samples, owner, of_tree = np.concatenate(samples), np.concatenate(owner), np.concatenate(of_tree)
    feet = np.array([one.foot[:2] for one in trees])
    if args.even:
        points, seen = even(rng, samples, args.even, noise_m)
    else:
        points, seen = scan(rng, samples, tripods(rng, scanners, feet, plot_m), args.step, noise_m)
    owner, of_tree = owner[seen], of_tree[seen]
    azimuth, shift = rng.uniform(0, 2 * np.pi), np.r_[rng.uniform(-400, 400, 2), rng.uniform(80, 300)]
    turn = np.array([[np.cos(azimuth), -np.sin(azimuth), 0], [np.sin(azimuth), np.cos(azimuth), 0], [0, 0, 1]])
    points = points @ turn.T + shift
    folder.mkdir(parents=True, exist_ok=True)
    order = rng.permutation(len(points))
    write(folder / f"cloud.{args.format}", points[order], args.format)
    np.save(folder / "owner.npy", owner[order].astype(np.int16))
    np.save(folder / "tree.npy", of_tree[order].astype(np.int16))
    told = [dict(foot=(turn @ one.foot + shift).tolist(), branches=[
                dict(id=b.id, parent=b.parent, depth=b.depth, points=int(((owner == b.id) & (of_tree == number)).sum()),
                     freq_hz=b.freq_hz, damping=b.damping,
                     polyline=np.round(one.placed(z_up(b.nodes_m)) @ turn.T + shift, 5).tolist(),
                     radius=np.round(one.size * b.radius_m(np.linspace(0, 1, len(b.nodes_m))), 5).tolist())
                for b in one.branches]) for number, one in enumerate(trees)]
    truth = dict(seed=args.seed, leaves=args.leaves, noise_m=noise_m, scanners=scanners, points=len(points), turn=turn.tolist(),
                 **(told[0] if len(told) == 1 else dict(trees=told)))
    (folder / "truth.json").write_text(json.dumps(truth))


class Standing:
    """A tree at its place: turned about its axis, and of another size than it was grown."""

    def __init__(self, branches, foot=(0.0, 0.0, 0.0), azimuth=0.0, size=1.0):
        self.branches, self.foot, self.size = branches, np.array(foot), size
        sin, cos = np.sin(azimuth), np.cos(azimuth)
        self.turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])

    def placed(self, places):
        return self.size * places @ self.turn.T + self.foot


def plot(rng, args):
    """Trees by chance on a disc that has room for them, and its radius."""
    radius, feet = 0.75 * args.apart * np.sqrt(args.trees), []
    while len(feet) < args.trees:
        at = radius * np.sqrt(rng.random()) * np.exp(1j * rng.uniform(0, 2 * np.pi))
        if all(abs(at - other) >= args.apart for other in feet):
            feet.append(at)
        radius *= 1.001
    seeds = [args.seed] + [1000 * args.seed + k for k in range(1, args.trees)]
    return [Standing(tree.grow(np.random.default_rng(seed), args.leaves)[0], (at.real, at.imag, 0.0), rng.uniform(0, 2 * np.pi),
                     rng.uniform(0.6, 1.2)) for seed, at in zip(seeds, feet)], radius


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

    def __init__(self, rng, plot_m):
        self.slope, self.phase = rng.uniform(-0.1, 0.1, 2), rng.uniform(0, 2 * np.pi, 2)
        self.radius = plot_m + GROUND_RADIUS_M

    def height(self, x, y):
        bumps = 0.03 * (np.sin(2 * x + self.phase[0]) + np.sin(1.7 * y + self.phase[1]))
        at_foot = 0.03 * (np.sin(self.phase[0]) + np.sin(self.phase[1]))
        return self.slope[0] * x + self.slope[1] * y + bumps - at_foot

    def samples(self, rng):
        n = int(600_000 * (self.radius / GROUND_RADIUS_M) ** 2)
        r, angle = self.radius * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
        x, y = r * np.cos(angle), r * np.sin(angle)
        return np.stack([x, y, self.height(x, y) + rng.exponential(0.008, n)], axis=1)


def tripods(rng, scanners, feet, plot_m):
    """Places of scanners, about the plot; of more than four every second one among the trees."""
    first = rng.uniform(0, 2 * np.pi)
    for k in range(scanners):
        angle = first + 2 * np.pi * k / scanners + rng.normal(0, 0.15)
        far = plot_m + rng.uniform(*DISTANCE_M)
        at = far * np.array([np.cos(angle), np.sin(angle)])
        if scanners > 4 and k % 2:
            at *= rng.random() * plot_m / far
            while np.min(np.linalg.norm(feet - at, axis=1)) < 1.0:
                at = rng.uniform(-plot_m, plot_m, 2)
        yield np.array([*at, SCANNER_HEIGHT_M])


def scan(rng, samples, places, step_deg, noise_m):
    """What rays from the scanners' places meet first, and which samples these are."""
    points, met_samples = [], []
    for at in places:
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
        met_samples.append(seen)
    return np.concatenate(points), np.concatenate(met_samples)


def even(rng, samples, count, noise_m):
    """So many of the samples, with noise, and which these are."""
    seen = rng.choice(len(samples), count, False)
    return samples[seen] + rng.normal(0, 0.5 * noise_m, (count, 3)), seen


def write(path, points, form):
    if form == "xyz":
        np.savetxt(path, points, fmt="%.4f")
        return
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + points.astype("<f8").tobytes())


if __name__ == "__main__":
    main()
